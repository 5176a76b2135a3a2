"""Golden numbers of what is solved: built-in scenes, random mechanisms, imported models, compiled programs."""

import tempfile
from collections.abc import Iterator
from contextlib import redirect_stdout
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from golden.answers import (
    MEASURED,
    Row,
    by_component,
    by_unit,
    counted,
    errors_of,
    fact,
    facts_of,
    largest,
    logarithms,
    measured,
    values_of,
    verdicts_of,
)
from golden.facts import ROUNDING, text

import screwgauge
from screwgauge.cli import main

ENGINES = ("screw", "pinocchio", "mujoco", "pinocchio-full", "mujoco-full")
OWN = Path(__file__).parent / "scenes"
#: Times the tolerance of a step that a simulated number may be off by: another processor moved one of
#: a03-andrews-iftomm by 24.
INTEGRATED = 40.0
#: Numbers of one's own are wrong by this share of the largest, and of themselves.
WRONG = 1e-4


def listed(what: str) -> list[str]:
    with redirect_stdout(StringIO()) as out:
        assert main(["list", what]) == 0
    return [line.split()[0] for line in out.getvalue().splitlines() if line.strip() and not line.endswith(":")]


def own_scenes() -> list[str]:
    return sorted(path.stem for path in OWN.glob("*.toml"))


def given() -> list[str]:
    """Scenes of given motions."""
    return [name for name in [*listed("scenes"), *own_scenes()] if not scene_of(name).simulated]


def unsprung() -> list[str]:
    return [name for name in given() if not scene_of(name).applied.springs]


def simulations() -> list[str]:
    """The others."""
    return [name for name in [*listed("scenes"), *own_scenes()] if scene_of(name).simulated]


def files() -> list[str]:
    """Model files of the built-in mechanisms; reading those of forty loops takes as long as all others."""
    names = [name for name in listed("mechanisms") if name != "a02-fourbar-40"]
    return [f"{name}{ending}" for name in names for ending in (".urdf", "-full.xml", ".xml", "-full.urdf")]


def programs() -> list[str]:
    return [f"{name} {backend}" for backend in ("llvm", "numpy") for name in ("slider-crank", "3ups-upu-s", "delta")]


def scene_of(name: str) -> Any:
    own = OWN / f"{name}.toml"
    return screwgauge.load_scene(own if own.is_file() else name)


def few(scene: Any, n: int = 7) -> Any:
    first, last = scene.t.min(), scene.t.max()
    return scene if len(scene.t) <= n else scene.at(first + np.linspace(0.013, 0.987, n) * (last - first))


def scene(name: str) -> Iterator[Row]:
    """A given motion by all engines."""
    results = screwgauge.run(few(scene_of(name)), ENGINES)
    yield from values_of(results, by_component)
    for solution in results.solutions.values():
        yield from errors_of(solution)
    yield from verdicts_of(results)


def simulated(name: str) -> Iterator[Row]:
    whole = scene_of(name)
    some = whole if name in own_scenes() else whole.at(whole.t[[1, 2, 4, 8]])
    steps = some.start.integration
    results = screwgauge.run(some)
    yield from values_of(results, by_component, INTEGRATED * max(steps.rtol, steps.atol))
    energy = results.judge[results.judge["residual"] == "energy_balance"]
    for row in energy.to_dict("records") if steps.rtol > 1e-9 else ():
        yield f"{row['engine']} energy", logarithms([row["max_abs"], row["max_scaled"]], 0.05)
    yield from verdicts_of(results)


def wrong(name: str) -> Iterator[Row]:
    whole = few(scene_of(name), 5)
    right = screwgauge.run(whole, ("screw",)).solutions["screw"]
    forces = [quantity for quantity in right.values if quantity.endswith("force") or quantity == "reaction"]
    tables = {which: _off(right, whole.t, names) for which, names in (("all", [*right.values]), ("forces", forces))}
    results = screwgauge.run(whole.beside(**tables), ("screw", *tables))
    yield from measured(results.pairs, ["a", "b", "quantity", "unit"], "max_scaled", "rms")
    yield from measured(results.judge, ["engine", "residual", "unit"], "max_scaled", "max_abs")
    yield "exit status", text(results.exit_status)


def _off(right: Any, t: Any, wrong: list[str]) -> Any:
    columns = {}
    for quantity, values in right.values.items():
        if quantity.startswith("tree_force"):
            continue  # no number of one's own has a tree
        sizes = largest(values)
        for j, (name, unit) in enumerate(zip(values.components, values.units, strict=True)):
            column = values.array[:, j]
            off = WRONG * (column + sizes[unit] * np.cos(1.0 + np.arange(len(t)) + 2.0 * j))
            columns[f"{quantity}/{name}"] = column + off * (quantity in wrong)
    return screwgauge.Recorded(t, columns)


def covered(name: str) -> Iterator[Row]:
    moved = screwgauge.exciting(scene_of(name), samples=21)
    for which in ("t", "y", "yd", "ydd"):
        array = getattr(moved.motion, which)
        yield f"motion {which}", fact([np.abs(array).max(), np.sqrt(np.mean(array**2))], 1e-9 * np.abs(array).max())
    results = screwgauge.run(moved, ("screw",))
    cover = results.cover()
    yield "untested", text(", ".join(cover.untested) + "; absent: " + ", ".join(cover.absent))
    sizes = {"shares": [row["share"] for row in cover.shares], "effects": [row["effect"] for row in cover.parameters]}
    for which, each in sizes.items():
        yield which, logarithms(np.maximum(each, ROUNDING), 1e-4)
    yield from values_of(results, by_unit)


def proved(name: str) -> Iterator[Row]:
    results = screwgauge.run(few(scene_of(name), 2), ("screw", "truth"))
    truth = results.solutions["truth"]
    for quantity in truth.values:
        yield from by_unit(truth, quantity)
    yield from errors_of(truth)
    yield from verdicts_of(results)


def drawn(seed: str) -> Iterator[Row]:
    return _drawn(int(seed), ENGINES if int(seed) % 5 == 0 else ("screw",))


def _drawn(seed: int, engines: tuple[str, ...]) -> Iterator[Row]:
    try:
        results = screwgauge.run(screwgauge.random(seed), engines)
    except screwgauge.ScrewgaugeError as error:
        yield "refused", text(type(error).__name__)
        return
    yield "name", text(results.scene.name)
    yield from values_of(results, by_unit)
    yield from errors_of(results.solutions["screw"])
    yield "verdict", text(results.exit_status)
    yield from counted(results)


@cache
def models() -> Path:
    global _folder
    _folder = tempfile.TemporaryDirectory(prefix="golden-")
    with redirect_stdout(StringIO()):
        for name in listed("mechanisms"):
            assert main(["models", name, "--out", _folder.name]) == 0
    return Path(_folder.name)


def imported(file: str) -> Iterator[Row]:
    results = screwgauge.run(few(screwgauge.load_scene(models() / file), 5), ("screw",))
    yield from values_of(results, by_unit)
    yield from facts_of(results)


def compiled(case: str) -> Iterator[Row]:
    name, backend = case.split()
    some = few(scene_of(name), 5)
    solver, motion = screwgauge.compile(some, backend=backend), some.motion
    n = 6 * len(some.applied.loads)
    loads = [None] if not n else [None, np.cos(np.arange(5 * n, dtype=float)).reshape(5, n)]
    for load in loads:
        answer = solver(motion.y, motion.yd, motion.ydd, load=load, estimates=True)
        for quantity, array in answer.values.items():
            off = max(1e-13, 10.0 * float(np.max(answer.estimate[quantity]))) if load is None else 1e-10
            size = float(np.abs(array).max())
            weights = np.cos(1.0 + 2.0 * np.arange(array.size)).reshape(array.shape)
            key = f"{quantity}{' under other loads' if load is not None else ''}"
            yield key, fact([np.sqrt(np.mean(array**2)), np.mean(weights * array), size], off * size)
        for quantity, estimate in answer.estimate.items() if load is None else ():
            yield f"estimate of {quantity}", logarithms([float(x) for x in estimate.max(axis=0)], MEASURED)
        yield "by array", text(answer.by_array)
    yield "notes", text(solver.notes)
