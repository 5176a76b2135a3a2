"""The row of one scene, one pair of models, or one smoke test. How many of them are run: `run`."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.diagnosis.diagnose import diagnose
from screwgauge.diagnosis.differences.difference import ALL, Difference, digits_of
from screwgauge.diagnosis.notes import INEXACT
from screwgauge.diagnosis.verdict import SAME
from screwgauge.engines.registry import ENGINES
from screwgauge.environment import environment
from screwgauge.judging.allowance import Allowance
from screwgauge.judging.compare import compare
from screwgauge.judging.residual import JUDGE, Residual
from screwgauge.models.catalog import description_files
from screwgauge.quantities import QUANTITIES
from screwgauge.reference.errors import DescriptionError, ScrewgaugeError
from screwgauge.reference.files import read_file
from screwgauge.reference.mobility import Mobility
from screwgauge.scene.default import exciting
from screwgauge.scene.motion import same_times
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution, Values
from screwgauge.study.comparison import Comparison
from screwgauge.study.gate.items import GateRow, Item
from screwgauge.study.outcome import Outcome, weakest
from screwgauge.study.run import run
from screwgauge.study.user_files import physical

#: What half a unit of the last digit in each of some hundred numbers makes of a force, in such units.
DIGITS = 50.0


@dataclass(frozen=True, slots=True)
class GateSettings:
    """How items are checked; pickles.

    Attributes:
        tolerances: Scaled errors that are admitted of quantities for which a scene has none.
        tell: Makes a sentence or two of a comparison.
        more: Makes a sentence of what files have more than is compared.
    """

    tell: Callable[[Comparison], str]
    smoke: bool = False
    tolerances: Mapping[str, float] | None = None
    more: Callable[[Comparison], str] = lambda results: ""


def measured(item: Item, settings: GateSettings, progress: Callable[..., None]) -> GateRow:
    """The row of an item; bad input and engines that fail are rows, too. `progress`: see `compared`."""
    try:
        row = _pair(item, settings) if len(item.files) == 2 else _scene(item, settings, progress)
    except ScrewgaugeError as error:
        row = GateRow(item.name, "failed" if error.exit_status == 3 else "refused", str(error), file=item.files[0])
    return replace(row, read=(*row.read, *item.files))


def _scene(item: Item, settings: GateSettings, progress: Callable[..., None]) -> GateRow:
    scene = load_scene(item.files[0])
    row = _smoke(scene, settings, progress) if settings.smoke else compared(scene, settings, progress)[0]
    return replace(row, scene=item.name, file=row.file or item.files[0])


def _smoke(scene: Scene, settings: GateSettings, progress: Callable[..., None]) -> GateRow:
    """A few samples of a scene; if they pass, a test of the comparison itself, and the full cuts."""
    scene, note = smoked(scene)
    row, results = compared(scene, settings, progress)
    row = replace(row, coverage=f"{note}{row.coverage}")
    if not row.ok:
        return row
    if unseen := blind(results):
        return replace(row, status="failed", sentence=f"the comparison would see no difference: {unseen}")
    if (cut := full_cuts(scene)) is None:
        return row
    full, full_results = compared(cut, settings, progress)
    errors, versions = (*row.errors, *full.errors), {**row.versions, **full.versions}
    coverage = f"{row.coverage} Full cuts: {OF_FULL_CUTS} of {', '.join(full_results.scene.engines)}."
    row = replace(row, errors=errors, versions=versions, coverage=coverage)
    if full.ok:
        return row
    return replace(row, status=full.status, sentence=f"of the full cuts: {full.sentence}")


def compared(
    scene: Scene, settings: GateSettings, progress: Callable[..., None] = lambda share, step: None
) -> tuple[GateRow, Comparison]:
    """The row of a scene, and the comparison. `progress`: takes a share and the engine at work."""
    usual = settings.tolerances or {}
    given = {**dict.fromkeys(usual, "--tolerances"), **dict.fromkeys(scene.tolerances, "the scene")}
    scene = replace(scene, tolerances={**usual, **scene.tolerances})
    results = run(scene, progress=lambda step, share: progress(share, step))
    errors = tuple(_errors(results, given))
    status = _status(results, errors)
    agree, sentence = status in ("unread", "agree", "judged"), settings.tell(results)
    if agree and not results.ok:
        sentence = "all is within tolerances that are wider than the usual ones for the reasons given"
    file, line = str(scene.file or ""), 0
    for name, model in scene.models.items():
        differences = [] if agree else physical(scene, name, model)
        if differences or not line:
            file, line = str(model), _line(model, differences)
    record = results.provenance
    files = {**record["models"], "description": record["description"], "scene": {"sha256": record.get("scene_sha256")}}
    hashes = {name: str(entry["sha256"] or "") for name, entry in files.items()}
    versions = {name: solution.version for name, solution in results.solutions.items()}
    row = GateRow(scene.name, status, sentence, errors, results.coverage.sentence, versions, hashes, file, line)
    read = [str(path) for path in files_of(scene, [*results.solutions, *results.failures])]
    row = replace(row, doubts=results.doubts, unread=results.unread, read=read)
    return replace(row, more=settings.more(results) if results.left_out.terms else ""), results


def _status(results: Comparison, errors: Sequence[Residual]) -> Outcome:
    """The weakest of what became of a comparison, where digits of a model file may have widened tolerances."""
    outcomes = [*results.outcomes, *_UNREAD[: len(results.unread)]]
    if all(one.ok for one in errors):
        outcomes = [each for each in outcomes if each not in _SIZED] or ["agree"]
    return weakest(outcomes)


_UNREAD: list[Outcome] = ["unread"]
#: Outcomes that wider tolerances change.
_SIZED: list[Outcome] = ["differ", "faulted", "undecided"]


def files_of(scene: Scene, engines: Iterable[str] | None = None) -> list[Path]:
    """Files that a scene is made of, those that its description extends included.

    Args:
        engines: Those that ran: models and tables of others count only without.
    """
    files = {**scene.models, **{name: table.file for name, table in scene.tables.items()}}
    used = [file for name, file in files.items() if engines is None or name in engines]
    described = description_files(scene.mechanism_file)
    return [file for file in (scene.file, *described, *used) if file is not None]


def _errors(results: Comparison, given: Mapping[str, str]) -> Iterator[Residual]:
    """Pairs and residuals with their tolerances.

    Args:
        given: Quantity -> who gave its tolerance.
    """
    pairs = [{**row, "of": (row["a"], row["b"])} for row in results.pairs.to_dict("records")]
    judged = [
        {**row, "quantity": row["residual"], "a": row["engine"], "b": JUDGE, "of": (row["engine"],)}
        for row in results.judge.to_dict("records")
    ]
    for row in [*pairs, *judged]:
        quantity, unit, a, b = (str(row[key]) for key in ("quantity", "unit", "a", "b"))
        tolerance, reason = derived(results, row, given)
        ok = bool(row["ok"] or row["max_scaled"] <= tolerance)
        first, second = (nan if ok else _value(results, row, side) for side in "ab")
        where, t = str(row["worst_component"]), float(row["worst_t"])
        size = float(row["max_scaled"])
        yield Residual(quantity, unit, a, b, size, tolerance, reason, ok, where, t, (first, second))


def derived(results: Comparison, row: Mapping[Any, Any], given: Mapping[str, str]) -> tuple[float, str]:
    """The tolerance of a pair or residual, and where it comes from.

    That of the comparison, and the digits that a model file is cut to where it differs from the description in nothing
    else.
    """
    quantity, tolerance, scene = str(row["quantity"]), float(row["tolerance"]), results.scene
    usual = "the tolerance of the integration" if scene.simulated else "rounding times the usual condition"
    reason = f"from {given[quantity]}" if quantity in given else usual
    solutions = [results.solutions[name] for name in row["of"] if name in results.solutions]
    if quantity in QUANTITIES and tolerance > scene.tolerance(quantity):
        reason = f"{reason}, {_admitted(scene, quantity, solutions)}"
    if quantity not in QUANTITIES and row["ok"] and row["reason"]:
        reason = str(row["reason"])
    if quantity in given or row["max_scaled"] <= tolerance:
        return tolerance, reason
    for solution in solutions:
        model = scene.models.get(solution.engine)
        differences = physical(scene, solution.engine, model) if model else []
        if model and differences and all(each.kind == "digits" for each in differences):
            n = digits_of(read_file(model))
            tolerance, reason = tolerance + DIGITS * 10.0 ** (1 - n), f"{reason}, {n} digits of {model.name}"
    return tolerance, reason


def _admitted(scene: Scene, quantity: str, solutions: Sequence[Solution]) -> str:
    """What makes the tolerance of a quantity wider than that of the scene."""
    if scene.simulated:
        return "what integration leaves"
    tables = [one.engine for one in solutions if one.engine in scene.tables]
    if stated := [name for name in tables if quantity in scene.tables[name].error]:
        return f"the error that {stated[0]} states"
    errors = [one.errors[quantity] for one in solutions if quantity in one.errors]
    return max(errors, key=lambda error: max(error.absolute.values(), default=0.0)).source


def _value(results: Comparison, pair: Mapping[Any, Any], side: str) -> float:
    """An engine's value where and when the difference is largest; NaN if it has none."""
    solution = results.solutions.get(pair[side])
    values = solution.values.get(pair["quantity"]) if solution is not None else None
    if values is None or pair["worst_component"] not in values.components or not np.isfinite(pair["worst_t"]):
        return nan
    row = int(np.argmin(np.abs(results.times - pair["worst_t"])))
    return float(values.array[row, values.components.index(pair["worst_component"])])


def _pair(item: Item, settings: GateSettings) -> GateRow:
    """The row of two model files: torques at random states, and differences of the files."""
    a, b = (Path(name) for name in item.files)
    diagnosis = diagnose(a, b)
    given = (settings.tolerances or {}).get("tree_force")
    rounded = bool(diagnosis.differences) and all(each.kind == "digits" for each in diagnosis.differences)
    tolerance, reason = given or SAME, "from --tolerances" if given else "rounding"
    n = min(diagnosis.a.digits, diagnosis.b.digits)
    if not given and rounded:
        tolerance, reason = SAME + DIGITS * 10.0 ** (1 - n), f"rounding, {n} digits of a file"
        if n >= ALL:  # whose rounding it is not
            tolerance, reason = INEXACT, "tensors as MuJoCo compiles them"
    errors = []
    if diagnosis.attribution is not None:
        most = diagnosis.attribution.before
        ok = most.scaled <= tolerance
        errors = [Residual("tree_force", most.unit, a.name, b.name, most.scaled, tolerance, reason, ok, most.component)]
    within = given is not None and all(each.size <= given for each in diagnosis.differences)
    agree = (diagnosis.same or rounded or within) and bool(errors) and all(one.ok for one in errors)
    agree &= not diagnosis.not_compared and (diagnosis.together is None or diagnosis.together.row.scaled <= tolerance)
    status: Outcome = "failed" if diagnosis.exit_status == 3 else "agree" if agree else "differ"
    known = environment()["packages"]
    packages = {name: known[name] for name in ("pin", "mujoco")}
    hashes = {model.label: model.sha256 for model in (diagnosis.a, diagnosis.b)}
    where = _line(b, diagnosis.differences)
    row = GateRow(item.name, status, diagnosis.verdict, tuple(errors), "", packages, hashes, str(b), where)
    return replace(row, doubts=diagnosis.doubts)


def _line(file: Path, differences: tuple[Difference, ...] | list[Difference]) -> int:
    """The line of a model file that names what differs first, 1 where none does."""
    names = [each.item_b for each in differences if each.item_b]
    text = read_file(file) if names else ""
    match = re.search(rf"name\s*=\s*[\"']{re.escape(names[0])}[\"']", text) if names else None
    return text.count("\n", 0, match.start()) + 1 if match else 1


#: Samples of an exciting motion, out of 101, that a smoke test looks at, and how large that is [rad or lengths]: what
#: takes time is the way there.
SMOKE, LARGEST = np.arange(7, 22, 7), 0.25
#: Share of its duration that a smoke test integrates of a simulation.
BEGINNING = 1e-2
#: Compared of the full cuts: what all loops, and how they move, come into.
OF_FULL_CUTS = "joint_acceleration"
#: A planted difference as a multiple of its tolerance, and how exactly the comparison has to say how large it is.
PLANTED, EXACTLY = 4.0, 1e-3
TWIN = "planted"
#: Stands for that of the mechanism: no component is left open.
_ALL_DETERMINED = Mobility(0, 0, 0, 0, 0, 0, 0, 0, (), (), ())


def smoked(scene: Scene) -> tuple[Scene, str]:
    """A scene with a few samples, and a sentence on them.

    A few samples of an exciting motion; of its own where there is no room for one; the beginning of a simulation.
    """
    if scene.simulated:
        since = scene.start.since
        end = since + BEGINNING * (float(scene.t[-1]) - since)
        return scene.at([since, end]), f"The first {end - since:.3g} s. "
    try:
        moving = exciting(scene, samples=int(SMOKE[-1]) + 1, largest=LARGEST)
        return replace(moving, name=scene.name, task=moving.motion.part(SMOKE)), f"{len(SMOKE)} samples. "
    except DescriptionError as error:
        # of the times that each table has
        every = [same_times(scene.t, table.t)[0] for table in scene.tables.values()] or [np.arange(len(scene.t))]
        rows = np.unique([one[np.linspace(0, len(one) - 1, len(SMOKE)).astype(np.intp)] for one in every])
        return replace(scene, task=scene.motion.part(rows)), f"{len(rows)} samples of its own motion ({error.what}). "


def full_cuts(scene: Scene) -> Scene | None:
    """A copy of a scene for `screw` and its engines' full cuts, all on the description, and one quantity.

    Terms that only a full cut has, such as those of welded copies of moving bodies, are seen by nothing else. None
    where there are none, or they run anyway, or nothing is given that they could solve.
    """
    names = [name for name in (f"{engine}-full" for engine in scene.engines) if name in ENGINES]
    if scene.simulated or not names or {*names} <= {*scene.engines}:
        return None
    return replace(scene, engines=("screw", *names), quantities=(OF_FULL_CUTS,), models={}, tables={})


def blind(results: Comparison) -> str:
    """Why a comparison without differences would mean nothing: a planted difference that it misses or missizes.

    An answer is compared with a copy in which one number of each quantity and unit is off by a known amount.

    Returns:
        A sentence; empty if every planted difference is seen, and its size is right.
    """
    scene = results.scene
    for quantity, unit, first, second, size in _planted(next(iter(results.solutions.values()), None), scene):
        both, problem = {one.engine: one for one in (first, second)}, scene.problem((quantity,))
        pairs = compare(scene.mechanism, problem, both, {}, _ALL_DETERMINED, Allowance(scene.tolerance))[1]
        compared_rows = [row for row in pairs.to_dict("records") if row["unit"] == unit]
        what = f"{quantity} [{unit}]: a planted difference of {size:.3g} scaled"
        if len(compared_rows) != 1:
            return f"{what} was not compared"
        (row,) = compared_rows
        if not abs(row["max_scaled"] - size) <= EXACTLY * size:
            return f"{what} was compared as {row['max_scaled']:.3g}"
        if row["ok"]:
            return f"{what} passes a tolerance of {scene.tolerance(quantity):.3g}"
    return ""


def _planted(solution: Solution | None, scene: Scene) -> Iterator[tuple[str, str, Solution, Solution, float]]:
    """Quantity and unit, an answer with that quantity alone, its copy with a number that is off, and by how much.

    What is zero throughout, or not a number, is no measure of anything and left out.
    """
    if solution is None:
        return
    for quantity, values in solution.values.items():
        for unit in dict.fromkeys(values.units):
            array, of = values.array.copy(), [i for i, one in enumerate(values.units) if one == unit]
            largest = float(np.abs(array[:, of]).max(initial=0.0))
            if not 1e-3 < largest < np.inf:
                continue
            row, column = np.unravel_index(np.argmax(np.abs(array[:, of])), (len(array), len(of)))
            size = PLANTED * scene.tolerance(quantity)
            array[row, of[column]] -= np.sign(array[row, of[column]]) * size * largest
            other = Values(values.components, values.units, array)
            first = replace(solution, values={quantity: values}, errors={})
            yield quantity, unit, first, replace(first, engine=TWIN, values={quantity: other}), size
