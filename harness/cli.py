"""The command line. Only argparse is imported before a command is chosen."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from screwgauge import __version__
from screwgauge.reference.errors import ScrewgaugeError

if TYPE_CHECKING:
    from screwgauge.scene import Scene

DEFAULT_SCENE = "3ups-upu-s"
EXIT_STATUS = """exit status: 0 agreement within tolerance; 1 out of tolerance or nothing compared;
2 bad input or usage; 3 an engine failed or is missing"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command.

    Returns:
        The exit status.
    """
    options = _parser().parse_args(arguments)
    try:
        return int(options.command(options))
    except ScrewgaugeError as error:
        if options.debug:
            import traceback

            traceback.print_exc()
        else:
            print(f"screwgauge: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("screwgauge: interrupted; nothing was written.", file=sys.stderr)
        return 130


def _say(text: str) -> None:
    """Prints; a reader of the pipe who has gone changes nothing about the exit status."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="screwgauge",
        description="Do two descriptions of a mechanism's motion agree, by how much, and if not, why?",
        epilog=EXIT_STATUS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"screwgauge {__version__}")
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--debug", action="store_true", help="show the traceback of an error")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    show = commands.add_parser("list", parents=[common], help="what there is to choose from")
    show.add_argument("what", nargs="?", choices=["mechanisms", "scenes", "engines", "quantities", "cases"])
    show.set_defaults(command=_list)

    models = commands.add_parser(
        "models", parents=[common], help="write URDF, MJCF and loops files of a mechanism, both cuts"
    )
    models.add_argument("mechanism", metavar="MECHANISM", help="built-in name or path of a TOML file")
    models.add_argument("--out", type=Path, metavar="DIR", help="default: screwgauge-out/MECHANISM")
    models.add_argument(
        "--include", default="", metavar="A,B", help="parts to add: contacts, limits, geoms, sensors"
    )
    models.add_argument(
        "--check",
        action="store_true",
        help="compare what yourdfpy, Pinocchio and MuJoCo read with the description",
    )
    models.set_defaults(command=_models)

    run = commands.add_parser(
        "run",
        parents=[common],
        help="drive the engines with a scene, compare them, write the report",
        epilog=EXIT_STATUS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    run.add_argument(
        "scene",
        nargs="?",
        default=DEFAULT_SCENE,
        metavar="SCENE",
        help="built-in name or path of a TOML file",
    )
    run.add_argument("--engines", metavar="A,B", help="default: those of the scene")
    run.add_argument("--quantities", metavar="A,B", help="default: all; nothing else is computed")
    run.add_argument("--out", type=Path, metavar="DIR", help="default: screwgauge-out/SCENE")
    run.add_argument(
        "--samples", action="store_true", help="write all samples too (samples.parquet; needs pyarrow)"
    )
    run.add_argument("--json", action="store_true", help="print the summary as JSON")
    run.set_defaults(command=_run)
    _add_bench(commands, common)
    _add_stress(commands, common)

    paper = commands.add_parser(
        "paper", parents=[common], help="measure the errata of the paper, each by its effect"
    )
    paper.add_argument("--out", type=Path, metavar="DIR", help="default: screwgauge-out/paper")
    paper.set_defaults(command=_paper)
    return parser


def _add_bench(commands: Any, common: argparse.ArgumentParser) -> None:
    bench = commands.add_parser(
        "bench", parents=[common], help="error against run time of many methods and settings"
    )
    bench.add_argument(
        "scene", nargs="?", default=DEFAULT_SCENE, metavar="SCENE", help="name or path of a TOML file"
    )
    bench.add_argument("--out", type=Path, metavar="DIR", help="default: screwgauge-out/SCENE")
    bench.add_argument("--quick", action="store_true", help="fewer samples and rounds, the same columns")
    bench.add_argument(
        "--budget",
        type=float,
        metavar="SECONDS",
        help="begin nothing after that (480, --quick 48; forward scenes 90, --quick 25)",
    )
    bench.add_argument("--contestants", metavar="A,B", help="families or contestants; default: all")
    bench.set_defaults(command=_bench)


def _add_stress(commands: Any, common: argparse.ArgumentParser) -> None:
    stress = commands.add_parser(
        "stress",
        parents=[common],
        help="stiff and extreme cases: digits kept, and whether an engine says so where it keeps few",
        epilog="exit status: 0 every row is there; 1 our own solver is silently wrong somewhere; 2 bad input; "
        "3 a rung broke",
    )
    stress.add_argument("cases", nargs="*", metavar="CASE", help="default: all ('list' shows them)")
    stress.add_argument("--out", type=Path, metavar="DIR", help="default: screwgauge-out/stress")
    stress.add_argument("--quick", action="store_true", help="fewer rungs, smaller scenes, the same columns")
    stress.add_argument("--severity", metavar="A,B", help="these rungs of the one case named")
    stress.set_defaults(command=_stress)


def _names(text: str | None) -> list[str] | None:
    return None if text is None else [name.strip() for name in text.split(",") if name.strip()]


def _list(options: argparse.Namespace) -> int:
    from screwgauge.listing import listing

    _say(listing(options.what))
    return 0


def _models(options: argparse.Namespace) -> int:
    from screwgauge.models.catalog import load_mechanism
    from screwgauge.models.generate import write_models
    from screwgauge.preflight import check_home

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


def _run(options: argparse.Namespace) -> int:
    from screwgauge.bench.threads import fix_threads

    fix_threads()  # matrices are small: on a busy machine the threads of BLAS wait for each other twenty-fold
    from screwgauge.driver import run
    from screwgauge.progress import Line
    from screwgauge.report.summary import summary_text
    from screwgauge.report.terminal import format_terminal
    from screwgauge.report.write import check_writable
    from screwgauge.scene import load_scene

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


def _bench(options: argparse.Namespace) -> int:
    from screwgauge.bench.threads import fix_threads

    fix_threads()  # before anything imports numpy
    from dataclasses import replace

    from screwgauge.bench.journal import NAME
    from screwgauge.bench.run import FULL, QUICK, bench, check_budget
    from screwgauge.bench.terminal import format_terminal
    from screwgauge.bench.write import write_bench
    from screwgauge.progress import Line
    from screwgauge.report.write import check_writable
    from screwgauge.scene import load_scene

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


def _stress(options: argparse.Namespace) -> int:
    from screwgauge.bench.threads import fix_threads

    fix_threads()  # before anything imports numpy
    from screwgauge.progress import Line
    from screwgauge.reference.expressions import number
    from screwgauge.report.write import check_writable
    from screwgauge.stress.run import stress
    from screwgauge.stress.terminal import format_terminal
    from screwgauge.stress.write import write_stress

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


def _contest(options: argparse.Namespace, scene: Scene, out: Path) -> int:
    """The bench of a forward scene."""
    from dataclasses import replace

    from screwgauge.bench.run import check_budget
    from screwgauge.forward.contest.report import format_terminal, write_contest
    from screwgauge.forward.contest.run import FULL, QUICK, contest
    from screwgauge.progress import Line

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


def _paper(options: argparse.Namespace) -> int:
    from screwgauge.paper.document import format_terminal, write_paper
    from screwgauge.paper.measure import measure
    from screwgauge.progress import Line
    from screwgauge.report.write import check_writable

    out = options.out or Path("screwgauge-out") / "paper"
    check_writable(out)
    with Line(sys.stderr) as line:
        paper = measure(line.show)
        line.show("report", 1.0)
        write_paper(paper, out)
    print(format_terminal(paper))
    print(f"\nreport: {out / 'report.html'}")
    return 0 if paper.complete else 1


if __name__ == "__main__":
    sys.exit(main())
