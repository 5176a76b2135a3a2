"""Measures with which versions of the engines cases are shown, for ``shown.toml`` of the package."""

import json
import os
import subprocess
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from casebook.reproduce import RUN
from screwgauge.casebook.book import CASES, Case, installed_versions, version_key
from screwgauge.processes import python as this_python
from screwgauge.study.matrix import Maker, lay_out, make_environment, requirements

TESTS = Path(__file__).parents[1]
CRASHED = "crashed"
#: Of the processes of one environment [s].
LIMIT = 3600.0
HEAD = """\
# Versions, in the order of a case's `engines`, with which tests/casebook reproduced the case or did not; numbers
# were measured with the newest versions. Written by pytest -m campaign -k casebook --reports=harness
"""

#: The status of a case, and its numbers.
Found = tuple[str, Mapping[str, str]]


def found_by(
    python: Sequence[str] | None = None, package: Path | None = None, cases: Sequence[str] = RUN
) -> dict[str, Found]:
    """Name -> `Found` of cases, run by another Python. One that takes its process along is `CRASHED`, others go on.

    Args:
        python: How that Python is called; this one by default.
        package: Folder in which it finds screwgauge, if that is not installed there.
    """
    path = os.pathsep.join(str(each) for each in (package, TESTS) if each)
    return dict(_found(python or this_python(), {**os.environ, "PYTHONPATH": path}, [*cases]))


def _found(python: Sequence[str], environment: Mapping[str, str], cases: list[str]) -> Iterator[tuple[str, Found]]:
    while cases:
        command = [*python, "-m", "casebook.reproduce", *cases]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=LIMIT)
        lines = [json.loads(line) for line in done.stdout.splitlines() if line.startswith('["')]
        yield from ((name, (status, numbers)) for name, status, numbers in lines)
        cases = [case for case in cases if case not in {name for name, *_ in lines}]
        if cases:
            yield cases.pop(0), (CRASHED, {})


def measured(pairs: Iterable[tuple[str, str]], folder: Path, make: Maker = make_environment) -> dict[str, Case]:
    """The cases with what a fresh environment of each pair of versions, of pin and mujoco, shows.

    Those of other engines are shown by the installed versions, where they are installed.
    """
    cases = {**CASES}
    for pin, mujoco in pairs:
        place = folder / f"pin-{pin}-mujoco-{mujoco}"
        python = make(place / "environment", requirements(pin=pin, mujoco=mujoco))
        lay_out(place / "package")
        both = [name for name in RUN if {*CASES[name].engines} <= {"pinocchio", "mujoco"}]
        for name, found in found_by([str(python), "-P"], place / "package", both).items():
            cases[name] = grown(cases[name], {"pinocchio": pin, "mujoco": mujoco}, found)
    further = [name for name in RUN if not {*CASES[name].engines} <= {"pinocchio", "mujoco"}]
    here = {
        name: dict(zip(CASES[name].engines, installed_versions(CASES[name]) or (), strict=False)) for name in further
    }
    for name, found in found_by(cases=[name for name in further if here[name]]).items():
        cases[name] = grown(cases[name], here[name], found)
    return cases


def grown(case: Case, versions: Mapping[str, str], found: Found) -> Case:
    status, numbers = found
    pair = tuple(versions[engine] for engine in case.engines)
    shown, not_shown = {*case.shown} - {pair}, {*case.not_shown} - {pair}
    if status in ("shown", "not shown"):
        (shown if status == "shown" else not_shown).add(pair)
    newest = max(shown | not_shown, key=version_key, default=())
    return replace(
        case,
        shown=tuple(sorted(shown, key=version_key)),
        not_shown=tuple(sorted(not_shown, key=version_key)),
        numbers=numbers if pair == newest else case.numbers,
    )


def text(cases: Iterable[Case]) -> str:
    """The text of ``shown.toml``."""
    return "\n".join([HEAD, *(_entry(case) for case in cases if case.shown or case.not_shown)])


def _entry(case: Case) -> str:
    values = {"shown": case.shown, "not_shown": case.not_shown}
    rows = [f"{name} = {json.dumps(value)}" for name, value in values.items() if value]
    inside = ", ".join(f"{name} = {json.dumps(said)}" for name, said in case.numbers.items())
    return "\n".join([f"[{json.dumps(case.id)}]", *rows, f"numbers = {{ {inside} }}", ""])
