"""Results for one scene or one pair of models. `run` checks many of them; for smoke tests see `smoke`."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.diagnosis.answer import Difference
from screwgauge.diagnosis.diagnose import diagnose
from screwgauge.diagnosis.facts.fact import ALL, INEXACT, digits_of
from screwgauge.diagnosis.model import weigh_side
from screwgauge.diagnosis.shares import SAME
from screwgauge.environment import environment
from screwgauge.judging.coverage import Coverage
from screwgauge.judging.residual import JUDGE, Residual
from screwgauge.models.catalog import description_files
from screwgauge.models.importing.model import scratch_folder
from screwgauge.problem import spread
from screwgauge.quantities import QUANTITIES
from screwgauge.reference.files import read_file
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution
from screwgauge.study.comparison import Comparison
from screwgauge.study.gate.items import GateRow, Item, admissions
from screwgauge.study.mismatches import physical_differences
from screwgauge.study.outcome import Outcome, weakest
from screwgauge.study.run import run

#: Error in a force due to half a unit in the last digit of each of some hundred numbers, in units of the last digit.
DIGITS = 50.0
CURVE = 400  # number of samples kept for a scene that does not pass


@dataclass(frozen=True, slots=True)
class GateSettings:
    """Settings for checking items. They can be pickled.

    Attributes:
        tolerances: Allowed scaled errors of quantities for which the scene does not specify a tolerance.
        tell: Function that describes a comparison in a sentence or two.
        more: Function that returns a sentence on content of the files that is not part of the compared machine.
        meshes: Compute mass and inertia of model files from meshes.
    """

    tell: Callable[[Comparison], str]
    smoke: bool = False
    tolerances: Mapping[str, float] | None = None
    more: Callable[[Comparison], str] = lambda results: ""
    meshes: bool = False


def compare_scene(
    scene: Scene,
    settings: GateSettings,
    progress: Callable[..., None] = lambda share, step: None,
    *,
    covered: bool = True,
) -> tuple[GateRow, Comparison]:
    """Compare engines on a scene; return its row, and the comparison.

    Args:
        progress: Called with the completed share and the running engine.
        covered: Also describe what the motion tests, which takes extra time.
    """
    usual = settings.tolerances or {}
    given = {**dict.fromkeys(usual, "--tolerances"), **dict.fromkeys(scene.tolerances, "the scene")}
    scene = replace(scene, tolerances={**usual, **scene.tolerances})
    results = run(scene, progress=lambda step, share: progress(share, step))
    results = results if covered else replace(results, cover=Coverage)
    errors = tuple(_errors(results, given))
    status = _status(results, errors)
    agree, sentence = status in ("unread", "agree", "judged"), settings.tell(results)
    if agree and not results.ok:
        sentence = "everything is within tolerances, which are wider than usual for the reasons given"
    file, line = str(scene.file or ""), 0
    for name, model in scene.models.items():
        differences = [] if agree else physical_differences(scene, name, model)
        if differences or not line:
            file, line = str(model), _line(model, differences)
    record = results.provenance
    files = {**record["models"], "description": record["description"], "scene": {"sha256": record.get("scene_sha256")}}
    hashes = {name: str(entry["sha256"] or "") for name, entry in files.items()}
    versions = {name: solution.version for name, solution in results.solutions.items()}
    row = GateRow(scene.name, status, sentence, errors, results.coverage.sentence, versions, hashes, file, line)
    read = [str(path) for path in files_of(scene, [*results.solutions, *results.failures])]
    used = dict.fromkeys([*scene.quantities, *scene.tolerances])
    leave = admissions({quantity: scene.tolerance(quantity) for quantity in used}, scene.allow)
    row = replace(row, doubts=results.reservations, unread=results.unread, read=read, admitted=leave)
    row = replace(row, remarks=scene.mechanism.remarks)
    more = settings.more(results) if results.left_out.terms else ""
    return replace(row, more=more, curve=_curve(results, row.worst)), results


def _status(results: Comparison, errors: Sequence[Residual]) -> Outcome:
    """Return the weakest outcome of a comparison; `errors` may have wider tolerances for rounded model files."""
    outcomes = [*results.outcomes]
    if all(one.ok for one in errors):
        outcomes = [each for each in outcomes if each not in _SIZED] or ["agree"]
    if results.unread:
        outcomes.append("unread")
    return weakest(outcomes)


#: Outcomes that wider tolerances may change.
_SIZED: list[Outcome] = ["differ", "faulted", "undecided"]


def files_of(scene: Scene, engines: Iterable[str] | None = None) -> list[Path]:
    """Return the files that make up a scene, including files that its description extends.

    Args:
        engines: Engines that ran; models and tables of all other engines are omitted. None for all engines.
    """
    files = {**scene.models, **{name: table.file for name, table in scene.tables.items()}}
    used = [file for name, file in files.items() if engines is None or name in engines]
    described = description_files(scene.mechanism_file)
    return [file for file in (scene.file, *described, *used) if file is not None]


def _errors(results: Comparison, given: Mapping[str, str]) -> Iterator[Residual]:
    """Yield the errors of pairs and of residuals, with their tolerances."""
    pairs = [{**row, "of": (row["a"], row["b"])} for row in results.pairs.to_dict("records")]
    judged = [
        {**row, "quantity": row["residual"], "a": row["engine"], "b": JUDGE, "of": (row["engine"],)}
        for row in results.judge.to_dict("records")
    ]
    for row in [*pairs, *judged]:
        quantity, unit, a, b = (str(row[key]) for key in ("quantity", "unit", "a", "b"))
        tolerance, reason = derive_tolerance(results, row, given)
        ok = bool(row["ok"] or row["max_scaled"] <= tolerance)
        where, t, size = str(row["worst_component"]), float(row["worst_t"]), float(row["max_scaled"])
        found = Residual(quantity, unit, a, b, size, tolerance, reason, ok, where, t)
        first, second = (nan if ok else _value(results, found, engine) for engine in (a, b))
        yield replace(found, values=(first, second))


def derive_tolerance(results: Comparison, row: Mapping[Any, Any], given: Mapping[str, str]) -> tuple[float, str]:
    """Return the tolerance of a pair or residual, and the source of the tolerance.

    The tolerance of the comparison is widened if the only differences between a model file and the description are due
    to rounded digits.
    """
    quantity, tolerance, scene = str(row["quantity"]), float(row["tolerance"]), results.scene
    usual = "the tolerance of the integration" if scene.simulated else "rounding times the usual condition number"
    reason = f"from {given[quantity]}" if quantity in given else usual
    solutions = [results.solutions[name] for name in row["of"] if name in results.solutions]
    if quantity in QUANTITIES and tolerance > scene.tolerance(quantity):
        reason = f"{reason}, {_reason_to_widen(scene, quantity, solutions)}"
    if quantity not in QUANTITIES and row["ok"] and row["reason"]:
        reason = str(row["reason"])
    if quantity in given or row["max_scaled"] <= tolerance:
        return tolerance, reason
    for solution in solutions:
        model = scene.models.get(solution.engine)
        differences = physical_differences(scene, solution.engine, model) if model else []
        if model and differences and all(each.kind == "digits" for each in differences):
            n = digits_of(read_file(model))
            tolerance, reason = tolerance + DIGITS * 10.0 ** (1 - n), f"{reason}, {n} digits in {model.name}"
    return tolerance, reason


def _reason_to_widen(scene: Scene, quantity: str, solutions: Sequence[Solution]) -> str:
    """Return the reason why the tolerance of a quantity is wider than the scene's tolerance."""
    if scene.simulated:
        return "the integration error"
    tables = [one.engine for one in solutions if one.engine in scene.tables]
    if stated := [name for name in tables if quantity in scene.tables[name].error]:
        return f"the error stated in {stated[0]}"
    errors = [one.errors[quantity] for one in solutions if quantity in one.errors]
    return max(errors, key=lambda error: max(error.absolute.values(), default=0.0)).source


def _column(results: Comparison, worst: Residual, engine: str) -> Array | None:
    """Return an engine's values of the worst component; None if the engine lacks it. Shape (n,)."""
    solution = results.solutions.get(engine)
    values = solution.values.get(worst.quantity) if solution is not None else None
    if values is None or worst.component not in values.components:
        return None
    return values.array[:, values.components.index(worst.component)]


def _value(results: Comparison, worst: Residual, engine: str) -> float:
    """Return an engine's value at the component and time of the largest difference; NaN if it lacks the component."""
    column = _column(results, worst, engine)
    if column is None or not np.isfinite(worst.t):
        return nan
    return float(column[int(np.argmin(np.abs(results.times - worst.t)))])


def _curve(results: Comparison, worst: Residual | None) -> tuple[tuple[float, float, float], ...]:
    """Return times [s] and values of both engines for the worst error, if it is out of tolerance."""
    if worst is None or worst.ok:
        return ()
    first, second = (_column(results, worst, engine) for engine in (worst.a, worst.b))
    if first is None or second is None:
        return ()
    some = [*spread(len(results.times), CURVE), int(np.argmin(np.abs(results.times - worst.t)))]
    return tuple(map(tuple, np.stack([results.times, first, second], axis=1)[np.unique(some)].tolist()))


def compare_pair(item: Item, settings: GateSettings) -> GateRow:
    """Compare two model files: torques at random states, and differences between the files."""
    a, b = (Path(name) for name in item.files)
    sides = (weigh_side(name, scratch_folder()) for name in item.files) if settings.meshes else (a, b)
    diagnosis = diagnose(*sides)
    given = (settings.tolerances or {}).get("tree_force")
    rounded = bool(diagnosis.differences) and all(each.kind == "digits" for each in diagnosis.differences)
    tolerance, reason = given or SAME, "from --tolerances" if given else "rounding"
    n = min(diagnosis.a.digits, diagnosis.b.digits)
    if not given and rounded:
        tolerance, reason = SAME + DIGITS * 10.0 ** (1 - n), f"rounding, {n} digits in a file"
        if n >= ALL:  # the difference is not due to rounding
            tolerance, reason = INEXACT, "accuracy of inertia tensors compiled by MuJoCo"
    found = diagnosis.found
    most = found.torques if found.agreement is None else found.agreement
    ok = most.scaled <= tolerance
    errors = [Residual("tree_force", most.unit, a.name, b.name, most.scaled, tolerance, reason, ok, most.component)]
    within = given is not None and all(each.size <= given for each in diagnosis.differences)
    agree = found.alike and (diagnosis.same or rounded or within) and ok
    agree &= not diagnosis.not_compared and (found.together is None or found.together.row.scaled <= tolerance)
    status: Outcome = "failed" if diagnosis.exit_status == 3 else "agree" if agree else "differ"
    known = environment()["packages"]
    packages = {name: known[name] for name in ("pin", "mujoco")}
    hashes = {model.label: model.sha256 for model in (diagnosis.a, diagnosis.b)}
    where = _line(b, diagnosis.differences)
    row = GateRow(item.name, status, diagnosis.verdict, tuple(errors), "", packages, hashes, str(b), where)
    return replace(row, doubts=diagnosis.doubts, admitted=admissions({"tree_force": given} if given else {}))


def _line(file: Path, differences: tuple[Difference, ...] | list[Difference]) -> int:
    """Return the line of a model file that names the first differing item; 1 if no line does."""
    names = [each.item_b for each in differences if each.item_b]
    text = read_file(file) if names else ""
    match = re.search(rf"name\s*=\s*[\"']{re.escape(names[0])}[\"']", text) if names else None
    return text.count("\n", 0, match.start()) + 1 if match else 1
