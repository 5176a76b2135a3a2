"""Who takes part in a bench of a given motion or of a simulation, and how they are chosen."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from itertools import product, zip_longest
from typing import Any

from screwgauge.engines.methods import METHODS
from screwgauge.engines.registry import engines
from screwgauge.problem import InitialValue
from screwgauge.reference.errors import check_choice
from screwgauge.reference.expressions import number
from screwgauge.scene.simulation import EXPLICIT
from screwgauge.study.bench import leaving_out, questions
from screwgauge.study.bench.contestant import TABLE, Contestant
from screwgauge.study.methods import Method
from screwgauge.study.reference import QUANTITIES

#: What an entry may say as a contestant has it.
_AS_IT_IS = ("family", "name", "setting", "covers", "series", "label", "drawn", "given", "hint")

_COVERS = "integration from start to end, closing of the loops and output at the samples; loading outside"
_SIMULATOR = partial(Contestant, question=questions.simulation, quantities=("observable",), covers=_COVERS)
#: Tolerances of a step, rtol = atol. An implicit method of low order needs too many steps for the tighter ones.
LADDER = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
LEAST_IMPLICIT = 1e-8
QUICK_LADDER = (1e-4, 1e-7)
#: Engines that hold their loops by constraint forces gain nothing below this: rounding of those is larger.
LEAST_CONSTRAINED = 1e-10
#: Fixed steps over the whole motion.
STEPS = (250, 1_000, 4_000, 16_000, 64_000)
QUICK_STEPS = (100, 400, 1_600)


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


def simulators(method: str, duration: float, *, quick: bool) -> list[Contestant]:
    """Who takes part in the bench of a simulation, the coarse settings of all families first.

    Args:
        method: That of the scene.
        duration: Of the motion [s].
    """
    families = *_climbing(method, quick), *_stepping(duration, quick)
    return [contestant for turn in zip_longest(*families) for contestant in turn if contestant]


def _climbing(own: str, quick: bool) -> Iterator[list[Contestant]]:
    """Engines by scipy's methods, each a ladder of tolerances."""
    for engine in (name for name, engine in engines().items() if InitialValue in engine.tasks):
        screw = engine == "screw"
        for method in METHODS if screw else (own,):
            least = max(0.0 if screw else LEAST_CONSTRAINED, 0.0 if method in EXPLICIT else LEAST_IMPLICIT)
            rungs = [rtol for rtol in (QUICK_LADDER if quick else LADDER) if rtol >= least]
            if screw and quick and method != own:  # in a quick bench only the scene's own method climbs
                rungs = rungs[:1]
            family, found = f"screw-{method}" if screw else engine, list[Contestant]()
            for rtol in rungs:
                setting, label = f"{method}, rtol = atol = {rtol:.0e}", f"{rtol:.0e}".replace("e-0", "e-")
                question = partial(questions.simulation, method=method, rtol=rtol)
                found.append(_SIMULATOR(family, family, setting, Method(engine), question=question, label=label))
            yield found


def _stepping(duration: float, quick: bool) -> Iterator[list[Contestant]]:
    """The engines' own steppers, each over fixed steps."""
    for stepper in TABLE["steppers"]:
        family, engine, found = stepper["family"], stepper["engine"], list[Contestant]()
        for dt in (duration / n for n in (QUICK_STEPS if quick else STEPS)):
            method, setting = Method(engine, {"dt": dt, **stepper["settings"]}), stepper["setting"].format(dt=dt)
            found.append(_SIMULATOR(family, family, setting, method, parameter=("dt [s]", dt), label=_label(dt)))
        yield found


def _label(dt: float) -> str:
    """A step with its unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9)):
        if dt >= size:
            return f"{dt / size:.3g} {unit}"
    return f"{dt:.1e} s"
