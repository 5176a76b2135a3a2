"""Who takes part in a bench of a given motion, and how they are chosen."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from itertools import product
from typing import Any

from screwgauge.reference.errors import check_choice
from screwgauge.reference.expressions import number
from screwgauge.study.bench import leaving_out, questions
from screwgauge.study.bench.contestant import TABLE, Contestant
from screwgauge.study.method import Method
from screwgauge.study.posed import QUANTITIES

#: What an entry may say as a contestant has it.
_AS_IT_IS = ("family", "name", "setting", "covers", "series", "label", "drawn", "given", "hint")


def contestants(*, quick: bool) -> list[Contestant]:
    """All of them, family by family. `quick`: settings that take longest are left out."""
    return [*(one for entry in TABLE["lines"] for one in _expanded(entry, quick)), *leaving_out.contestants()]


def _expanded(entry: Mapping[str, Any], quick: bool) -> Iterator[Contestant]:
    """The contestants of an entry of ``contestants.toml``, which says what it means."""
    axes = [
        [value if isinstance(value, dict) else {name: value} for value in values]
        for name, values in entry.get("over", {}).items()
    ]
    for quantities in [{"quantities": [name]} for name in QUANTITIES] if "each" in entry else [{}]:
        for combination in product([{**entry, **quantities}], *axes):
            values = {name: value for table in combination for name, value in table.items()}
            if not (quick and "slow" in values):
                yield _contestant(values)


def _contestant(values: Mapping[str, Any]) -> Contestant:
    def filled(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: filled(inner) for name, inner in value.items()}
        if isinstance(value, str):
            return values.get(value[1:]) if value.startswith("$") else value.format(**values)
        return value

    fields = {name: filled(values[name]) for name in _AS_IT_IS if name in values}
    asked = filled(values["question"])
    question = getattr(questions, asked.pop("ask"))
    parameter = None
    if varied := values.get("parameter"):
        parameter = varied[0], number(filled(varied[1]), "contestants.toml")
    if "named" in values and (parameter is None or parameter[1] not in values["named"]):
        fields["label"] = ""
    return Contestant(
        **fields,
        method=Method(values["engine"], filled(values.get("settings", {}))),
        question=partial(question, **asked) if asked else question,
        quantities=tuple(values["quantities"]),
        parameter=parameter,
    )


def choose(wanted: Iterable[str] | None, *, quick: bool = False) -> list[Contestant]:
    """The named families and contestants, of a quick bench or a full one; all by default.

    Raises:
        ScrewgaugeError: A name is not known, or there is none.
    """
    everyone = contestants(quick=quick)
    if wanted is None:
        return everyone
    known = contestants(quick=False)
    names = dict.fromkeys([*(c.family for c in known), *(c.name for c in known)])
    chosen = set(check_choice("contestant", wanted, names))
    return [contestant for contestant in everyone if {contestant.family, contestant.name} & chosen]
