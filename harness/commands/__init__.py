"""What each command of the command line does; returns its exit status. Imports come with the command."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from screwgauge.models.importing import is_model
from screwgauge.reference.errors import DescriptionError, ScrewgaugeError
from screwgauge.report.console import complain, say

if TYPE_CHECKING:
    from screwgauge.study.apart import Limits

OUT = Path("screwgauge-out")


def list_(options: argparse.Namespace) -> int:
    """What there is to choose from."""
    from screwgauge.report.listing import listing

    say(listing(options.what))
    return 0


def models(options: argparse.Namespace) -> int:
    """Writes the model files of a mechanism, and compares what programs read, if asked to."""
    from screwgauge.models.catalog import load_mechanism
    from screwgauge.models.generate import write_models
    from screwgauge.models.mjcf import left_out
    from screwgauge.scene.default import gravity_of
    from screwgauge.scene.preflight import check_home

    imported(options.mechanism)
    check_home(mechanism := load_mechanism(options.mechanism))
    out = options.out or OUT / mechanism.name / "models"
    said: dict[str, Any] = {} if (g := gravity_of(options.mechanism)) is None else {"gravity": g}
    for path in write_models(mechanism, out, include=frozenset(_names(options.include) or ()), **said):
        say(str(path))
    for sentence in left_out(mechanism):
        say(sentence)
    if not options.check:
        return 0
    from screwgauge.models.check import check_models, check_table

    say(check_table(rows := check_models(mechanism, out, **said)))
    return 0 if all(row.ok for row in rows) else 1


def import_(options: argparse.Namespace) -> int:
    """Writes a URDF or MJCF as a description and a scene, and says what neither holds."""
    from screwgauge.models.importing.convert import Wanted
    from screwgauge.models.importing.model import Options, notes
    from screwgauge.scene.imported import write_imported
    from screwgauge.study.campaigns.loading import import_apart

    independent, actuated = _names(options.independent), _names(options.actuated)
    wanted = Wanted(None if independent is None else dict(zip(independent, independent, strict=True)), actuated)
    choice = Options(options.loops, options.reader or "", options.floating, options.meshes, wanted)
    found = import_apart(options.file, choice)
    for path in write_imported(found, options.out or Path(f"{options.file.stem}.toml")):
        say(str(path))
    for sentence in notes(found):
        say(sentence)
    return 0


def imported(name: str) -> None:
    """Imports a model file that is named in place of a mechanism or scene, and says what became of it."""
    if is_model(name):
        from screwgauge.models.importing.model import keep, notes
        from screwgauge.reference.files import beside
        from screwgauge.study.campaigns.loading import import_apart

        for sentence in notes(keep(path := beside(Path(), name), import_apart(path))[1]):
            complain(f"screwgauge: {sentence}")


def run(options: argparse.Namespace) -> int:
    """Drives the engines with a scene and writes the report."""
    from screwgauge.environment import json_text
    from screwgauge.report.pages import run as page
    from screwgauge.report.pdf import browser
    from screwgauge.report.results import run
    from screwgauge.scene.read import load_scene

    imported(options.scene)
    scene = load_scene(options.scene)
    if options.exciting:
        from screwgauge.scene.exciting import exciting

        scene = exciting(scene, options.seed or 0)
    elif options.seed is not None:
        raise DescriptionError("--seed is that of an exciting motion", "run", "add --exciting or leave it out")
    if options.pdf:
        browser()  # or none is found, which is told before any work
    out = options.out or OUT / scene.name
    engines, quantities = _names(options.engines), _names(options.quantities)
    more: Any = {"limits": limits(options), "warn": lambda text: complain(f"screwgauge: warning: {text}")}
    results = carry_out(
        page,
        out,
        lambda progress: run(scene, engines, quantities, progress=progress, **more),
        tell=(lambda found: json_text(page.summary(found), escaped=True)) if options.json else None,
        samples=options.samples,
        errata=options.errata,
        pdf=options.pdf,
    )
    for failure in results.failures.values() if options.debug else ():
        complain(failure.traceback)
    return int(results.exit_status)


def bench(options: argparse.Namespace) -> int:
    """Error against run time of a scene, or engines on random mechanisms."""
    if options.random is not None:
        return _random(options)
    from screwgauge.report.pages.bench import PAGE, SIMULATION
    from screwgauge.scene.read import load_scene
    from screwgauge.study.bench import forward_run
    from screwgauge.study.bench import run as given_run
    from screwgauge.study.bench.stamp import NAME

    imported(options.scene)
    scene = load_scene(options.scene)
    out = options.out or OUT / scene.name / "bench"
    study = forward_run if scene.simulated else given_run
    plan = study.QUICK if options.quick else study.FULL
    if options.budget is not None:
        plan = replace(plan, budget=given_run.check_budget(options.budget))
    more: dict[str, Any] = {"plan": plan, "contestants": _names(options.contestants)}
    if scene.simulated:
        carry_out(SIMULATION, out, lambda progress: forward_run.contest(scene, progress=progress, **more))
        return 0
    more["journal"] = out / NAME
    carry_out(PAGE, out, lambda progress: given_run.bench(scene, progress=progress, **more), again=NAME)
    return 0


def _random(options: argparse.Namespace) -> int:
    """Random mechanisms of all families; those whose rows are there are not done again."""
    from screwgauge.report.pages.random import PAGE as page
    from screwgauge.study.campaigns.campaign import campaign

    out, names = options.out or OUT / "random", _names(options.contestants)
    carry_out(
        page,
        out,
        lambda progress: campaign(options.random, out / page.NAME, seed=options.seed, only=names, progress=progress),
        again=page.NAME,
    )
    return 0


def stress(options: argparse.Namespace) -> int:
    """Climbs the ladders of severity."""
    from screwgauge.reference.expressions import number
    from screwgauge.report.pages.stress import PAGE as page
    from screwgauge.study.stress import stress

    texts = _names(options.severity)
    severities = None if texts is None else [number(text, "--severity") for text in texts]
    out = options.out or OUT / "stress"
    more = {"quick": options.quick, "severities": severities}
    found = carry_out(page, out, lambda progress: stress(options.cases or None, progress=progress, **more))
    if found.broken:
        complain(f"screwgauge: a rung broke: {found.broken[0]}")
        return 3
    return 0 if found.ok else 1


def paper(options: argparse.Namespace) -> int:
    """Measures the errata of the paper."""
    from screwgauge.report.pages.paper import PAGE as page
    from screwgauge.study.paper.measure import measure

    out = options.out or OUT / "paper"
    return 0 if carry_out(page, out, measure).complete else 1


def diagnose(options: argparse.Namespace) -> int:
    """Compares two models, says why they differ and proves it; or shows a named discrepancy."""
    if options.case is not None:
        return _case(options)
    if options.self_test:
        return _self_test(options)
    from screwgauge.diagnosis.diagnose import diagnose
    from screwgauge.diagnosis.record import summary
    from screwgauge.environment import json_text
    from screwgauge.report.pages.diagnosis import PAGE as page
    from screwgauge.study.campaigns.loading import read_apart, sides

    if options.b is None:
        raise DescriptionError(
            "needs two models, a case or a self-test", "diagnose", "write A B, --case ID or --self-test"
        )
    more = {name: getattr(options, name) for name in ("map", "seed", "matrix", "loops")}
    more |= {} if options.limit is None else {"limit": options.limit}
    found = carry_out(
        page,
        options.out or OUT / "diagnosis",
        lambda progress: diagnose(*sides(options.a, options.b, options.meshes), load=read_apart, **more),
        tell=(lambda found: json_text(summary(found), escaped=True)) if options.json else None,
    )
    if options.fix is not None:
        say(f"fixed: {found.write_fix(options.fix)}")
        for sentence in found.not_fixed:
            say(f"not fixed: {sentence}")
    return int(found.exit_status)


def _self_test(options: argparse.Namespace) -> int:
    """Diagnoses models changed at random; those whose rows are there are not done again."""
    from screwgauge.report.pages.selftest import PAGE as page
    from screwgauge.report.pages.selftest import passed
    from screwgauge.study.selftest.run import counts, selftest

    check_taken(options, "a self-test", "diagnose --self-test", "self_test", "count", "quick", "seed", "out")
    out, (count, pairs) = options.out or OUT / "self-test", counts(options.count, options.quick)
    file, more = out / page.NAME, {"seed": options.seed, "quick": options.quick}
    found = carry_out(
        page, out, lambda progress: selftest(count, pairs, file, progress=progress, **more), again=page.NAME
    )
    return 0 if passed(found) else 1


def _case(options: argparse.Namespace) -> int:
    """Shows a named discrepancy with the installed engines."""
    from screwgauge.casebook.book import reproduce
    from screwgauge.report.casebook import blocks
    from screwgauge.report.terminal import terminal

    check_taken(options, "a case", "diagnose --case", "case")
    result = reproduce(options.case)
    say(terminal(blocks(result)))
    return 0 if result.ok else 3


def check_taken(options: argparse.Namespace, what: str, where: str, *taken: str) -> None:
    """Refuses options that something does not take by a DescriptionError."""
    if given := [name for name, value in vars(options).items() if value and name not in (*taken, "command", "debug")]:
        raise DescriptionError(f"{what} takes no {', '.join(given)}", where, "leave that out")


def carry_out(
    page: Any,
    out: Path,
    work: Callable[[Any], Any],
    *,
    tell: Callable[[Any], str] | None = None,
    again: str = "",
    **writing: Any,
) -> Any:
    """Works with progress, writes and shows the page of what was found; what cannot be written is not begun.

    Args:
        work: Takes the progress.
        tell: What to print of what was found; by default what the page has for a terminal.
        again: File that the same command goes on from.
        writing: What else the page is written with.

    Returns:
        What was found.
    """
    from screwgauge.report.folder import PAGES, SAMPLES, check_writable
    from screwgauge.report.progress import Progress
    from screwgauge.report.terminal import terminal

    check_writable(out, [*page.DATA, *([again] if again else []), *([SAMPLES] if writing.get("samples") else [])])
    lost: ScrewgaugeError | None = None
    with Progress(sys.stderr) as progress:
        try:
            found = work(progress.show)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(again and f"run the same command again to go on from {out / again}") from None
        progress.show("report", 0.0)
        try:
            page.write(found, out, **writing)
        except ScrewgaugeError as error:  # what was found is told all the same
            lost = error
    say(tell(found) if tell else f"{terminal(page.terminal(found))}\n\nreport: {'none' if lost else out / PAGES[1]}")
    if lost is not None:
        raise lost
    return found


def limits(options: argparse.Namespace) -> Limits:
    """What a process may take, as options say."""
    from screwgauge.study.apart import Limits

    given = {"seconds": options.limit, "memory": options.memory}
    return Limits(**{name: value for name, value in given.items() if value is not None})


def _names(text: str | None) -> list[str] | None:
    return None if text is None else [name.strip() for name in text.split(",") if name.strip()]
