"""The commands of the command line. Each command returns its exit status, and imports its dependencies when called."""

from __future__ import annotations

import argparse
import os
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from screwgauge.commands.execution import carry_out
from screwgauge.models.importing import MESHES, is_model
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.outputs import check_free
from screwgauge.report.console import complain, mark, say

if TYPE_CHECKING:
    from screwgauge.scene.scene import Scene
    from screwgauge.study.isolation import Limits
    from screwgauge.study.runner import Executor

OUT = Path("screwgauge-out")


def list_(options: argparse.Namespace) -> int:
    """Print the available mechanisms, scenes, engines and quantities."""
    from screwgauge.report.listing import listing

    say(listing(options.what))
    return 0


def models(options: argparse.Namespace) -> int:
    """Write the model files of a mechanism; with --check, compare what each library reads from them."""
    from screwgauge.models.catalog import load_mechanism
    from screwgauge.models.generate import keep_models
    from screwgauge.models.home import check_home
    from screwgauge.models.mjcf import left_out
    from screwgauge.models.readings.loops import loops_beside
    from screwgauge.reference.lint import implausible
    from screwgauge.scene.default import gravity_of
    from screwgauge.scene.read import is_scene, load_scene

    import_named(options.mechanism)
    scene, file = load_scene(options.mechanism) if is_scene(options.mechanism) else None, Path(options.mechanism)
    check_home(mechanism := scene.mechanism if scene else load_mechanism(file))
    out = options.out or OUT / mechanism.name / "models"
    g = scene.applied.g if scene else gravity_of(options.mechanism)
    given: dict[str, Any] = {} if g is None else {"gravity": g}
    included = frozenset(_names(options.include) or ())
    loops = loops_beside(file) if file.suffix == ".urdf" else None
    inputs = filter(None, [file, loops, scene.mechanism_file if scene else None])
    paths = keep_models(mechanism, out, inputs=inputs, force=options.force, include=included, **given)
    for line in (*map(str, paths), *left_out(mechanism), *mechanism.remarks, *implausible(mechanism)):
        say(line)
    if not options.check:
        return 0
    from screwgauge.models.check import check_models, check_table

    say(check_table(rows := check_models(mechanism, out, **given)))
    return 0 if all(row.ok for row in rows) else 1


def import_(options: argparse.Namespace) -> int:
    """Convert a URDF or MJCF, or a description without a home pose, to a description and a scene; print notes."""
    from screwgauge.diagnosis.shares import warn_of_order
    from screwgauge.models.files.parts import files_allowed
    from screwgauge.models.importing.model import Options, notes
    from screwgauge.scene.default import write_imported
    from screwgauge.study.loading import import_isolated

    out = options.out or Path(f"{options.file.stem}.toml")
    check_free(out, filter(None, (options.file, options.loops)), force=options.force)
    if options.file.suffix == ".toml":
        return _import_description(options, out)
    independent, actuated = _names(options.independent), _names(options.actuated)
    chosen = None if independent is None else dict(zip(independent, independent, strict=True))
    files = options.loops, options.reader or "", options.floating, options.meshes
    choice = Options(*files, chosen, actuated, _names(options.allow) or ())
    imported_model = import_isolated(options.file, choice)
    written = write_imported(imported_model, out, force=options.force)
    with files_allowed(options.file.parent, choice.allow):
        order = warn_of_order(options.file, imported_model, meshes=options.meshes)
    for line in (*map(str, written), *notes(imported_model), *order):
        say(line)
    return 0


def _import_description(options: argparse.Namespace, out: Path) -> int:
    from screwgauge.models.importing.description import import_description
    from screwgauge.scene.default import write_imported

    for name in ("loops", "independent", "actuated", "floating", "meshes", "reader", "allow"):
        if getattr(options, name):
            raise DescriptionError(
                f"--{name} applies only to model files", "import", "omit it, and edit the description"
            )
    description, text = import_description(options.file)
    for line in (*map(str, write_imported(description, out, text, force=options.force)), *description.remarks):
        say(line)
    return 0


def import_named(name: str, allow: list[str] | None = None, *, meshes: bool = False) -> None:
    """Import a model file that is named in place of a mechanism or scene, and print notes about it.

    Args:
        allow: See `models.importing.model.Options`.
        meshes: Compute mass and inertia from meshes.
    """
    if is_model(name):
        from screwgauge.models.importing.model import Options, keep, notes
        from screwgauge.reference.files import named_file
        from screwgauge.study.loading import import_isolated

        leave = [*(allow or ()), *[MESHES] * meshes]
        path = named_file(Path(), name)
        for sentence in notes(keep(path, import_isolated(path, Options(allow=leave)), leave)[1]):
            complain(f"screwgauge: {sentence}")
    elif allow or meshes:
        what = "--allow and --meshes apply only to model files"
        raise DescriptionError(what, "run", "add allow = [...] to the description or scene")


def run(options: argparse.Namespace) -> int:
    """Run the engines on a scene and write the report."""
    from screwgauge.api import run
    from screwgauge.environment import json_text
    from screwgauge.report.pages import run as page
    from screwgauge.report.results import csv_files
    from screwgauge.report.write import browser
    from screwgauge.scene.read import load_scene

    import_named(options.scene, _names(options.allow), meshes=options.meshes)
    scene = load_scene(options.scene)
    if options.exciting:
        from screwgauge.scene.default import exciting

        scene = exciting(scene, options.seed or 0)
    elif options.seed is not None:
        raise DescriptionError("--seed applies only to an exciting motion", "run", "add --exciting, or omit --seed")
    if options.pdf:
        browser()  # fail before any work if no browser is found
    out = options.out or OUT / scene.name
    engines, quantities = _names(options.engines), _names(options.quantities)
    more: Any = {"limits": limits(options), "warn": lambda text: complain(f"screwgauge: warning: {text}")}
    tables = {} if options.csv is None else csv_files(options.csv, engines or scene.engines)
    for table in tables.values():
        check_free(table, force=options.force)
    results = carry_out(
        page,
        out,
        lambda progress: run(scene, engines, quantities, progress=progress, **more),
        tell=(lambda answer: json_text(page.summary(answer), escaped=True)) if options.json else None,
        files=(_files(scene), {f"--csv {table}": table for table in tables.values()}),
        force=options.force,
        samples=options.samples,
        pdf=options.pdf,
    )
    if tables and results.solutions:
        for table in results.to_csv(options.csv, quantities=quantities, force=options.force):
            (complain if options.json else say)(f"values: {table}")
    for failure in results.failures.values() if options.debug else ():
        complain(failure.traceback)
    return int(results.exit_status)


def review(options: argparse.Namespace) -> int:
    """Report the faults in a table of numbers."""
    from screwgauge.api import review
    from screwgauge.environment import json_text
    from screwgauge.report.reviewed import blocks, summary
    from screwgauge.report.text import terminal

    import_named(options.scene)
    found = review(options.numbers, options.scene, _names(options.quantities))
    say(json_text(summary(found), escaped=True) if options.json else terminal(blocks(found)))
    return 0 if found else 1


def _files(scene: Scene) -> list[Path]:
    """Return the files that make up a scene."""
    tables = (table.file for table in scene.tables.values())
    return [file for file in (scene.file, scene.mechanism_file, *scene.models.values(), *tables) if file]


def bench(options: argparse.Namespace) -> int:
    """Measure errors against run times for a scene."""
    from screwgauge.report.pages.bench import PAGE, SIMULATION
    from screwgauge.scene.read import load_scene
    from screwgauge.study.bench.run import bench, plan_of

    import_named(options.scene)
    scene = load_scene(options.scene)
    out = options.out or OUT / scene.name / "bench"
    plan = plan_of(scene, quick=options.quick, limit=options.limit)
    more: dict[str, Any] = {"plan": plan, "contestants": _names(options.contestants), "place": out}
    if options.jobs is not None or options.cluster is not None:
        more["execute"] = executor(options)
    page, again = (SIMULATION, False) if scene.simulated else (PAGE, True)
    carry_out(page, out, lambda progress: bench(scene, progress=progress, **more), again=again, force=options.force)
    return 0


def stress(options: argparse.Namespace) -> int:
    """Run the stress cases with increasing severity."""
    from screwgauge.reference.expressions import number
    from screwgauge.report.pages.stress import PAGE as page
    from screwgauge.study.bench.stress import stress

    texts = _names(options.severity)
    severities = None if texts is None else [number(text, "--severity") for text in texts]
    out = options.out or OUT / "stress"
    more = {"quick": options.quick, "severities": severities, "execute": executor(options), "place": out}
    work = partial(stress, options.cases or None, **more)
    table = carry_out(page, out, lambda progress: work(progress=progress), again=True, force=options.force)
    if table.broken:
        complain(f"screwgauge: a severity failed: {table.broken[0]}")
        return 3
    return 0 if table.ok else 1


def sweep(options: argparse.Namespace) -> int:
    """Solve many variants of a scene, and rank its numbers by their effect."""
    from screwgauge.report.pages import sweep as page
    from screwgauge.study.sweep.plan import read_plan
    from screwgauge.study.sweep.run import sweep

    plan = read_plan(options.plan)
    out = options.out or OUT / options.plan.stem
    more: dict[str, Any] = {"place": out}
    if options.jobs is not None or options.cluster is not None:
        more["execute"] = executor(options)
    found = carry_out(
        page,
        out,
        lambda progress: sweep(plan, progress=progress, **more),
        files=([plan.file, *_files(plan.scene)], {}),
        again=True,
        force=options.force,
        samples=plan.table == "parquet",
    )
    return int(found.exit_status)


def identify(options: argparse.Namespace) -> int:
    """Report which numbers of a machine can be determined from its forces, and estimate them from data."""
    from screwgauge.report.pages.identify import PAGE
    from screwgauge.scene.read import load_scene
    from screwgauge.study.identify.fix import check_fix, write_fix
    from screwgauge.study.identify.run import identify

    import_named(options.scene)
    scene, model = load_scene(options.scene), Path(options.scene) if is_model(options.scene) else None
    inputs = [*_files(scene), *filter(None, (options.data, model))]
    if options.fix is not None:
        check_fix(options.fix, model, options.data)
        check_free(options.fix, inputs, force=options.force)
    more = {name: getattr(options, name) for name in ("noise", "prior", "seed") if getattr(options, name) is not None}
    found = carry_out(
        PAGE,
        options.out or OUT / scene.name / "identify",
        lambda progress: identify(
            scene, options.data, numbers=_names(options.numbers) or (), progress=progress, **more
        ),
        files=(inputs, {} if options.fix is None else {"--fix": options.fix}),
        force=options.force,
    )
    if options.fix is not None:
        for line in write_fix(found, options.fix, model, force=options.force):
            say(line)
    return int(found.exit_status)


def diagnose(options: argparse.Namespace) -> int:
    """Compare two models, explain their differences, and prove the explanation."""
    from screwgauge.diagnosis.diagnose import diagnose
    from screwgauge.diagnosis.findings import summary
    from screwgauge.environment import json_text
    from screwgauge.report.pages.diagnosis import PAGE, every_difference
    from screwgauge.study.loading import read_isolated, sides

    more = {name: getattr(options, name) for name in ("map", "seed", "loops", "only")}
    more |= {} if options.limit is None else {"limit": options.limit}
    if options.fix is not None:
        check_free(options.fix, _models(options), force=options.force)
    tell = (lambda answer: json_text(summary(answer), escaped=True)) if options.json else None
    diagnosis = carry_out(
        PAGE,
        options.out or OUT / "diagnosis",
        lambda progress: diagnose(*sides(options.a, options.b, options.meshes), load=read_isolated, **more),
        tell=tell or (every_difference if options.all else None),
        files=(_models(options), {} if options.fix is None else {"--fix": options.fix}),
        force=options.force,
    )
    if options.fix is not None:
        fixed = diagnosis.write_fix(options.fix, force=options.force)
        lines = [f"fixed: {fixed}", *(f"not fixed: {text}" for text in diagnosis.not_fixed)]
        (complain if options.json else say)("\n".join(lines))  # standard output must contain only JSON
    return int(diagnosis.exit_status)


def _models(options: argparse.Namespace) -> list[Path]:
    """Return the files that a diagnosis reads."""
    loops = options.loops if isinstance(options.loops, list) else [options.loops]
    named = [options.a, options.b, options.a.partition("@")[0], options.b.partition("@")[0], options.map, *loops]
    return [Path(name) for name in named if name]


def casebook(options: argparse.Namespace) -> int:
    """Describe a named discrepancy, or list all of them."""
    from screwgauge.casebook.book import find_case
    from screwgauge.report.listing import blocks, listing
    from screwgauge.report.text import terminal

    say(listing("discrepancies") if options.id is None else terminal(blocks(find_case(options.id))))
    return 0


def limits(options: argparse.Namespace) -> Limits:
    """Return the limits that the options set on the time and memory of a process."""
    from screwgauge.study.isolation import Limits

    given = {"seconds": options.limit, "memory": options.memory}
    return Limits(**{name: value for name, value in given.items() if value is not None})


def executor(options: argparse.Namespace, limits: Limits | None = None) -> Executor:
    """Choose the executor of tasks from the options."""
    from screwgauge.study.cluster import executor

    return executor(options.jobs, options.cluster, limits)


def _names(text: str | None) -> list[str] | None:
    return None if text is None else [name.strip() for name in text.split(",") if name.strip()]


def check(options: argparse.Namespace) -> int:
    """Check scenes and pairs of models; write the files that CI services read to the places where they expect them."""
    from screwgauge.commands.gate_files import check_files, check_inputs, check_outputs
    from screwgauge.report.pages.check import PAGE, check_with

    if options.update and options.baseline is None:
        raise DescriptionError("--update needs a baseline", "check", "pass its file with --baseline")
    if options.no_default and not options.what:
        raise DescriptionError("there is nothing to check", "check", "pass scenes, folders or model files")
    check_files(options)
    out, old = options.out or OUT / "check", None if options.update else options.baseline
    more = {"smoke": options.smoke, "tolerances": options.tolerances, "baseline": old, "meshes": options.meshes}
    execute, place = executor(options, limits(options)), None if options.cluster is None else out
    outcome = carry_out(
        PAGE,
        out,
        lambda progress: check_with(execute, options.what, **more, progress=progress, place=place),
        tell=(lambda outcome: outcome.json) if options.json else None,
        again=place is not None,
        files=(check_inputs(options), check_outputs(options)),
        force=options.force,
        junit=options.junit,
        baseline=options.baseline if options.update else None,
    )
    for line in outcome.annotations() if os.environ.get("GITHUB_ACTIONS") and not options.json else ():
        mark(line)
    return int(outcome.exit_status)


def matrix(options: argparse.Namespace) -> int:
    """Repeat the check with several versions of the engines; skip pairs of versions that already have rows."""
    from importlib.metadata import version
    from itertools import product

    from screwgauge.report.pages.matrix import PAGE as page
    from screwgauge.study.matrix import check_versions, matrix

    named = {"pin": options.pin, "mujoco": options.mujoco}
    versions = [check_versions((text or version(package)).split(","), package) for package, text in named.items()]
    out, pairs = options.out or OUT / "matrix", [(pin, mujoco) for pin, mujoco in product(*versions)]
    work = partial(matrix, pairs, out / page.NAME, execute=executor(options))
    table = carry_out(page, out, lambda progress: work(progress=progress), again=True, force=options.force)
    statuses = {*table["status"]}
    return 0 if statuses == {"agree"} else 1 if statuses <= {"agree", "differ"} else 3
