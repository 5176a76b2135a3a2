"""Golden numbers of diagnoses: pairs of models, and edits of small robots and of built-in mechanisms."""

import copy
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from campaigns.edits import KINDS, NoPlaceError
from golden.answers import Row
from golden.facts import Fact, text
from golden.solved import models

import screwgauge

ROBOTS = Path(__file__).parent / "robots"
OWN = ("arm.urdf", "arm.xml", "hand.xml", "hand.urdf")
BUILT_IN = ("arm7.urdf", "slider-crank.xml", "delta.urdf", "planetary-gear.xml", "3ups-upu-s.urdf", "screw-press.urdf")
SEED = 7
EDITS = 56
#: Pairs that were not edited: formats, cuts, and machines.
PAIRS = (
    "arm.urdf arm.xml",
    "hand.urdf hand.xml",
    "arm7.urdf arm7.xml",
    "slider-crank.urdf slider-crank-full.xml",
    "stewart-legs.urdf stewart-legs-full.urdf",
    "delta.xml delta-full.xml",
    "3-rps.urdf 3-upu.urdf",
    "planetary-gear.urdf planetary-gear.xml",
    "3ups-upu-s.urdf 3ups-upu-s-asymmetric.urdf",
    "3ups-upu-s.xml 3ups-upu-s-offset.xml",
)
CASES = [*PAIRS, *(f"edit {number}" for number in range(EDITS))]
#: Sizes that vary by rounding, and what they may be off by [decades].
NOTHING, SIZE = 1e-9, 1e-3


def diagnosis(case: str) -> Iterator[Row]:
    if case in PAIRS:
        a, b = map(_file, case.split())
        yield from _compared(a, b)
        return
    with tempfile.TemporaryDirectory(prefix="golden-") as folder:
        number = int(case.split()[1])
        kind, file, edited = _edited(number, Path(folder))
        yield "edit", text(f"{kind} of {file.name}")
        yield from _compared(*((file, edited) if number % 2 else (edited, file)), folder)


def _file(name: str) -> Path:
    return ROBOTS / name if name in OWN else models() / name


def _edited(number: int, folder: Path) -> tuple[str, Path, Path]:
    rng = np.random.default_rng([SEED, number])
    kind = list(KINDS)[number % len(KINDS)]
    for name in rng.permutation([*OWN, *BUILT_IN]):
        file = _file(str(name))
        root = copy.deepcopy(ET.parse(file).getroot())
        try:
            edit = KINDS[kind](root, rng)
        except (NoPlaceError, ValueError):
            continue
        edited = folder / file.name
        ET.ElementTree(root).write(edited, encoding="unicode")
        loops = file.with_suffix(".loops.toml")
        if loops.is_file() and not edit.beside:
            (folder / loops.name).write_text(loops.read_text(encoding="utf-8"), encoding="utf-8")
        if edit.beside:
            (folder / "robot.yaml").write_text(edit.beside, encoding="utf-8")
        return kind, file, edited
    raise LookupError(f"no file has a place for {kind}")


def _compared(a: Path, b: Path, folder: str = "") -> Iterator[Row]:
    try:
        answer = screwgauge.diagnose(a, b)
    except screwgauge.ScrewgaugeError as error:
        yield "refused", _clean(error, a, b, folder)
        return
    yield "verdict", _clean(answer.verdict, a, b, folder)
    yield "exit status", text(answer.exit_status)
    for i, each in enumerate(answer.differences):
        yield f"difference {i}", _clean(f"{each.kind}: {each.sentence}", a, b, folder)
        yield f"difference {i} size", _size([each.size])
    for name in ("not_compared", "not_fixed", "notes", "doubts", "left_out"):
        if sentences := getattr(answer, name):
            yield name, _clean(" | ".join(sentences), a, b, folder)
    for i, cause in enumerate(answer.causes):
        yield f"cause {i}", _clean(f"{cause.kind} of {cause.family}: {cause.sentence}", a, b, folder)
        if np.isfinite(cause.share):
            yield f"cause {i} share", Fact((float(cause.share),), SIZE)
    yield from _parts(answer.found)


def _parts(found: Any) -> Iterator[Row]:
    """Numbers of what was compared."""
    for label, change in found.by_joint:
        yield f"torque of {label}", _size([change])
    yield "torques", _size(_numbers(found.torques))
    for name in ("mobility", "agreement", "order"):
        if part := getattr(found, name):
            yield name, _size(_numbers(part))
    if (both := found.together) is not None:  # of what is rounding the unit may be either
        yield "together", text("the same") if both.agrees else _size(_numbers(both))
    if (fix := found.fix) is not None:
        yield "fix", text("proved" if fix.proved else "not proved" if fix.text else "none")
    for witness in found.witnesses:
        yield f"library {witness.library}", text(witness.agrees)


def _numbers(part: Any) -> list[float]:
    if is_dataclass(part) and not isinstance(part, type):
        return _numbers(list(asdict(part).values()))
    if isinstance(part, list | tuple | np.ndarray):
        return [number for each in part for number in _numbers(each)]
    return [float(part)] if isinstance(part, int | float | np.floating) else []


def _size(numbers: list[float]) -> Fact:
    sizes = np.abs(numbers)
    return Fact(tuple(float(x) for x in np.log10(np.maximum(sizes, NOTHING))), SIZE)


def _clean(sentence: object, a: Path, b: Path, folder: str) -> Fact:
    """Without places of this machine."""
    words = str(sentence)
    for place in (folder, str(a.parent), str(b.parent)):
        words = words.replace(place, "") if place else words
    return text(words)
