"""Models changed at random, each put to a diagnosis, and as many that only look different: one row each."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np
import pandas as pd
from campaigns.changes import CannotError
from campaigns.lookalikes import REWRITES
from campaigns.mutations import EVERYWHERE, KINDS, LOST, TRANSPOSED, Expected, mutated
from campaigns.public import ROBOTS, installed
from campaigns.rows import grown

from screwgauge.diagnosis.answer import Diagnosis, Difference, ToldCause
from screwgauge.diagnosis.diagnose import diagnose
from screwgauge.models.catalog import load_mechanism
from screwgauge.models.files.urdf import write_urdf
from screwgauge.models.mjcf import write_mjcf
from screwgauge.reference.errors import ScrewgaugeError
from support.robots import arm, mjcf, tree, urdf

#: Changes, and pairs that are alike for each.
COUNT, PAIRS = 500, 0.4
SMALLEST, LARGEST = 1e-6, 0.1  # relative size of a change
#: A change of torques below it [of the largest torque] need not be detected.
VISIBLE = 1e-9
#: A magnitude that is named is right within so much of it.
CLOSE = 0.01
CHANGED, ALIKE = "changed", "alike"
COLUMNS = (
    *("group", "number", "kind", "model", "public", "a", "b", "size", "effect", "detected", "right", "error"),
    *("proved", "cpu_s", "verdict", "first"),
)
BUILT_IN = ("arm7", "3ups-upu-s", "stewart")


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine and files that describe it, all in the same way.

    Attributes:
        files: Path and library that reads it, of each.
    """

    name: str
    files: tuple[tuple[Path, str], ...]
    public: bool = False


def machines(folder: Path) -> list[Machine]:
    files = {f"tree{seed}{ending}": text for seed in range(4) for ending, text in _texts(seed).items()}
    files["coupled.urdf"] = urdf(arm()).replace("</joint>", '<mimic joint="joint1" multiplier="0.5"/></joint>', 1)
    for name in BUILT_IN:
        mechanism = load_mechanism(name)
        files |= {f"{name}.urdf": write_urdf(mechanism, "minimal"), f"{name}.xml": write_mjcf(mechanism, "minimal")}
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return [*_made(folder), *_public()]


def _texts(seed: int) -> dict[str, str]:
    parts = tree(seed)
    return {".urdf": urdf(parts), ".xml": mjcf(parts), "-full.xml": mjcf(parts, full=True)}


def _read(*files: Path) -> tuple[tuple[Path, str], ...]:
    return tuple(
        (file, library)
        for file in files
        for library in (("pinocchio", "yourdfpy") if file.suffix == ".urdf" else ("mujoco",))
    )


def _made(folder: Path) -> Iterator[Machine]:
    for i in range(4):
        yield Machine(f"tree{i}", _read(folder / f"tree{i}.urdf", folder / f"tree{i}.xml"))
        yield Machine(f"tree{i}-full", _read(folder / f"tree{i}-full.xml"))
    yield Machine("coupled", _read(folder / "coupled.urdf"))
    for name in BUILT_IN:
        yield Machine(name, _read(folder / f"{name}.urdf"))
        yield Machine(f"{name}-mjcf", _read(folder / f"{name}.xml"))


def _public() -> Iterator[Machine]:
    for package, files in ROBOTS["selftest"].items():
        with suppress(PackageNotFoundError):
            for name, file in files.items():
                if (at := installed(package, file)).is_file():
                    yield Machine(name, _read(at), True)


def selftest(count: int, file: Path, progress: Callable[[str, float], None]) -> pd.DataFrame:
    """Diagnoses so many changed models, kinds of change in turn, and `PAIRS` as many pairs that are alike.

    Args:
        file: The table that they are for; rows that were made for it before are not made again.

    Returns:
        The table, sorted, columns `COLUMNS`.
    """
    of = {CHANGED: (count, [*KINDS]), ALIKE: (round(PAIRS * count), [*REWRITES])}
    items = {f"{group} {i}": (group, i, kinds[i % len(kinds)]) for group, (n, kinds) in of.items() for i in range(n)}
    with TemporaryDirectory(prefix="screwgauge-") as folder:
        known = machines(Path(folder))
        works = {name: partial(_rows, item, known, Path(folder)) for name, item in items.items()}
        text = grown(file, COLUMNS, works, lambda name, why: {"verdict": "failed", "first": why}, (), progress)
    return pd.read_csv(StringIO(text), keep_default_na=False).sort_values(["group", "number"], ignore_index=True)


def _rows(item: tuple[str, int, str], known: Sequence[Machine], folder: Path) -> list[dict[str, Any]]:
    group, number, kind = item
    return [{"group": group, "number": number, **row(kind, known, folder, [0, group == ALIKE, number])}]


def row(kind: str, known: Sequence[Machine], folder: Path, seed: Sequence[int]) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    size, reason = float(10.0 ** rng.uniform(np.log10(SMALLEST), np.log10(LARGEST))), ""
    for i in rng.permutation(len(known)):
        machine = known[int(i)]
        (first, library_a), (second, library_b) = (machine.files[k] for k in rng.integers(len(machine.files), size=2))
        copy = folder / f"b-{second.name}"
        try:
            text, expected = _written(kind, second, rng, size)
            copy.write_text(text, encoding="utf-8")
            begin = process_time()
            answer = diagnose(f"{first}@{library_a}", f"{copy}@{library_b}")
        except (CannotError, ScrewgaugeError) as error:
            reason = f"{type(error).__name__}: {error}"
            continue
        if first.suffix != second.suffix:  # the slip is made in an orientation that A does not write
            expected = [replace(e, slip="is turned") if e.slip in (LOST, TRANSPOSED) else e for e in expected]
        return {
            "kind": kind,
            "model": machine.name,
            "public": machine.public,
            "size": f"{size:.3g}" if expected else "",
            "a": f"{first.suffix[1:]} {library_a}",
            "b": f"{second.suffix[1:]} {library_b}",
            "cpu_s": f"{process_time() - begin:.3g}",
            "effect": f"{_effect(answer):.3g}",
            **(judged(answer, expected) if expected else _alike(answer)),
        }
    return {"kind": kind, "verdict": "no place", "first": reason}


def _written(kind: str, file: Path, rng: np.random.Generator, size: float) -> tuple[str, list[Expected]]:
    text = file.read_text(encoding="utf-8")
    return mutated(kind, text, rng, size) if kind in KINDS else (REWRITES[kind](text, rng), [])


def _effect(answer: Diagnosis) -> float:
    return answer.found.torques.scaled if answer.causes else np.inf


def _alike(answer: Diagnosis) -> dict[str, Any]:
    quiet = answer.same or answer.undecided
    return {
        "detected": not quiet,
        "verdict": "ok" if quiet else "false alarm",
        "first": "" if quiet else answer.verdict,
    }


def judged(answer: Diagnosis, expected: Sequence[Expected]) -> dict[str, Any]:
    """Compares a diagnosis with what was changed.

    Returns:
        Columns: detected; first, what it names first; right, whether that, or something that it cannot tell from it, is
        what was changed; error of the magnitude, relative; what backfill leaves; verdict.
    """
    named = [cause for cause in answer.causes if cause.share == cause.share and cause.kind != "unseen"]
    detected = not (answer.same or answer.undecided)
    right, error = _right(answer, expected, named) if detected else (False, np.nan)
    name = answer.causes[0].name if answer.causes else ""
    good = "wrong" if not right else "imprecise" if error > CLOSE else "ok"
    return {
        "detected": detected,
        "right": right,
        "error": f"{error:.2g}" if np.isfinite(error) else "",
        "first": name,
        "proved": bool(answer.found.fix and answer.found.fix.proved),
        "verdict": good if detected else "missed",
    }


def _right(answer: Diagnosis, expected: Sequence[Expected], causes: Sequence[ToldCause]) -> tuple[bool, float]:
    named = causes[: len(expected)]
    if expected[0].what == ("digits",):
        rounded = answer.differences and all(difference.kind == "digits" for difference in answer.differences)
        return rounded or any(cause.kind == "digits" for cause in named[:1]), np.nan
    told = [*named, *(cause for cause in answer.causes if cause not in causes)][: max(len(expected), 1)]
    values = [answer.differences[i] for cause in told for i in cause.differences]
    carriers = {link: name for name, body in answer.b.reading.bodies.items() for link in body.fixed}
    fitting = [[value for value in values if _fits(value, each, carriers)] for each in expected]
    slips = {text for cause in told for text in (cause.name, *cause.slips)}
    slipped = all(not each.slip or any(each.slip in slip for slip in slips) for each in expected)
    errors = [
        min(_error(value, each.magnitude) for value in some)
        for each, some in zip(expected, fitting, strict=True)
        if some and np.isfinite(each.magnitude)
    ]
    return all(fitting) and slipped, max(errors, default=np.nan)


def _fits(value: Difference, expected: Expected, carriers: Mapping[str, str]) -> bool:
    items = {value.item_a, value.item_b}
    part = expected.item == EVERYWHERE or bool({expected.item, carriers.get(expected.item)} & items)
    return part and value.what in expected.what


def _error(value: Difference, magnitude: float) -> float:
    step = np.asarray(value.b, dtype=float) - (0.0 if value.a is None else np.asarray(value.a, dtype=float))
    sizes = map(float, np.linalg.norm(step, axis=1)) if step.shape == (2, 3) else [float(np.linalg.norm(step))]
    return min(abs(size - abs(magnitude)) / abs(magnitude) for size in sizes)
