"""What each command of the command line does; returns its exit status. Imports come with the command."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from screwgauge.scene.scene import Scene


def show(options: argparse.Namespace) -> int:
    """What there is to choose from."""
    from screwgauge.report.listing import listing

    _say(listing(options.what))
    return 0


def models(options: argparse.Namespace) -> int:
    """Writes the model files of a mechanism, and compares what programs read, if asked to."""
    from screwgauge.models.catalog import load_mechanism
    from screwgauge.models.generate import write_models
    from screwgauge.scene.preflight import check_home

    mechanism = load_mechanism(options.mechanism)
    check_home(mechanism)
    out = options.out or Path("screwgauge-out") / mechanism.name
    for path in write_models(mechanism, out, include=frozenset(_names(options.include) or ())):
        _say(str(path))
    if not options.check:
        return 0
    from screwgauge.models.check import check_models, check_table

    rows = check_models(mechanism, out)
    _say(check_table(rows))
    return 0 if all(row.ok for row in rows) else 1


def run(options: argparse.Namespace) -> int:
    """Drives the engines with a scene and writes the report."""
    from screwgauge.study.bench.threads import fix_threads

    fix_threads()  # matrices are small: on a busy machine the threads of BLAS wait for each other twenty-fold
    from screwgauge.report.progress import Line
    from screwgauge.report.summary import summary_text
    from screwgauge.report.terminal import format_terminal
    from screwgauge.report.write import check_writable
    from screwgauge.scene.scene import load_scene
    from screwgauge.study.run import run

    scene = load_scene(options.scene)
    out = options.out or Path("screwgauge-out") / scene.name
    check_writable(out, samples=options.samples)
    with Line(sys.stderr) as line:
        results = run(
            scene,
            _names(options.engines),
            _names(options.quantities),
            progress=line.show,
            warn=lambda sentence: print(f"screwgauge: warning: {sentence}", file=sys.stderr, flush=True),
        )
        line.show("report", 0.0)
        results.write(out, samples=options.samples)
    if options.json:
        _say(summary_text(results))
    else:
        _say(format_terminal(results))
        _say(f"\nreport: {out / 'report.html'}")
    return results.exit_status


def bench(options: argparse.Namespace) -> int:
    """Error against run time of a scene."""
    from screwgauge.study.bench.threads import fix_threads

    fix_threads()  # before anything imports numpy
    from dataclasses import replace

    from screwgauge.report.bench.terminal import format_terminal
    from screwgauge.report.bench.write import write_bench
    from screwgauge.report.progress import Line
    from screwgauge.report.write import check_writable
    from screwgauge.scene.scene import load_scene
    from screwgauge.study.bench.journal import NAME
    from screwgauge.study.bench.run import FULL, QUICK, bench, check_budget

    plan = QUICK if options.quick else FULL
    if options.budget is not None:
        plan = replace(plan, budget=check_budget(options.budget))
    scene = load_scene(options.scene)
    out = options.out or Path("screwgauge-out") / scene.name
    check_writable(out)
    if scene.forward is not None:
        return _contest(options, scene, out)
    try:
        with Line(sys.stderr) as line:
            found = bench(
                scene,
                plan=plan,
                contestants=_names(options.contestants),
                journal=out / NAME,
                progress=line.show,
            )
            line.show("report", 0.0)
            write_bench(found, out)
    except KeyboardInterrupt:
        print(
            f"screwgauge: interrupted; run the same command again to go on from {out / NAME}.",
            file=sys.stderr,
        )
        return 130
    print(format_terminal(found))
    print(f"\nreport: {out / 'report.html'}")
    return 0


def _contest(options: argparse.Namespace, scene: Scene, out: Path) -> int:
    """The bench of a forward scene."""
    from dataclasses import replace

    from screwgauge.report.bench.forward_report import format_terminal, write_contest
    from screwgauge.report.progress import Line
    from screwgauge.study.bench.forward_run import FULL, QUICK, contest
    from screwgauge.study.bench.run import check_budget

    plan = QUICK if options.quick else FULL
    if options.budget is not None:
        plan = replace(plan, budget=check_budget(options.budget))
    with Line(sys.stderr) as line:
        found = contest(scene, plan=plan, contestants=_names(options.contestants), progress=line.show)
        line.show("report", 0.0)
        write_contest(found, out)
    _say(format_terminal(found))
    _say(f"\nreport: {out / 'report.html'}")
    return 0


def stress(options: argparse.Namespace) -> int:
    """Climbs the ladders of severity."""
    from screwgauge.study.bench.threads import fix_threads

    fix_threads()  # before anything imports numpy
    from screwgauge.reference.expressions import number
    from screwgauge.report.progress import Line
    from screwgauge.report.stress.terminal import format_terminal
    from screwgauge.report.stress.write import write_stress
    from screwgauge.report.write import check_writable
    from screwgauge.study.stress.run import stress

    severities = _names(options.severity)
    out = options.out or Path("screwgauge-out") / "stress"
    check_writable(out)
    with Line(sys.stderr) as line:
        found = stress(
            options.cases or None,
            quick=options.quick,
            severities=None if severities is None else [number(text, "--severity") for text in severities],
            progress=line.show,
        )
        line.show("report", 1.0)
        write_stress(found, out)
    _say(format_terminal(found))
    _say(f"\nreport: {out / 'report.html'}")
    if found.broken:
        print(f"screwgauge: a rung broke: {found.broken[0]}", file=sys.stderr)
        return 3
    return 0 if found.ok else 1


def paper(options: argparse.Namespace) -> int:
    """Measures the errata of the paper."""
    from screwgauge.report.paper.document import format_terminal, write_paper
    from screwgauge.report.progress import Line
    from screwgauge.report.write import check_writable
    from screwgauge.study.paper.measure import measure

    out = options.out or Path("screwgauge-out") / "paper"
    check_writable(out)
    with Line(sys.stderr) as line:
        paper = measure(line.show)
        line.show("report", 1.0)
        write_paper(paper, out)
    print(format_terminal(paper))
    print(f"\nreport: {out / 'report.html'}")
    return 0 if paper.complete else 1


def _names(text: str | None) -> list[str] | None:
    return None if text is None else [name.strip() for name in text.split(",") if name.strip()]


def _say(text: str) -> None:
    """Prints; a reader of the pipe who has gone changes nothing about the exit status."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
