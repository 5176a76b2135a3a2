"""The command line. Only argparse is imported before a command is chosen."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from screwgauge import __version__, commands
from screwgauge.reference.errors import ScrewgaugeError

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
    subparsers = parser.add_subparsers(required=True, metavar="COMMAND")

    show = subparsers.add_parser("list", parents=[common], help="what there is to choose from")
    show.add_argument("what", nargs="?", choices=["mechanisms", "scenes", "engines", "quantities", "cases"])
    show.set_defaults(command=commands.show)

    models = subparsers.add_parser(
        "models", parents=[common], help="write URDF, MJCF and loops files of a mechanism, both cuts"
    )
    models.add_argument("mechanism", metavar="MECHANISM", help="built-in name or path of a TOML file")
    models.add_argument("--out", type=Path, metavar="DIR", help="default: screwgauge-out/MECHANISM")
    models.add_argument("--include", default="", metavar="A,B", help="parts to add: contacts, limits, geoms, sensors")
    models.add_argument(
        "--check",
        action="store_true",
        help="compare what yourdfpy, Pinocchio and MuJoCo read with the description",
    )
    models.set_defaults(command=commands.models)

    run = subparsers.add_parser(
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
    run.add_argument("--samples", action="store_true", help="write all samples too (samples.parquet; needs pyarrow)")
    run.add_argument("--json", action="store_true", help="print the summary as JSON")
    run.set_defaults(command=commands.run)
    _add_bench(subparsers, common)
    _add_stress(subparsers, common)

    paper = subparsers.add_parser("paper", parents=[common], help="measure the errata of the paper, each by its effect")
    paper.add_argument("--out", type=Path, metavar="DIR", help="default: screwgauge-out/paper")
    paper.set_defaults(command=commands.paper)
    return parser


def _add_bench(subparsers: Any, common: argparse.ArgumentParser) -> None:
    bench = subparsers.add_parser("bench", parents=[common], help="error against run time of many methods and settings")
    bench.add_argument("scene", nargs="?", default=DEFAULT_SCENE, metavar="SCENE", help="name or path of a TOML file")
    bench.add_argument("--out", type=Path, metavar="DIR", help="default: screwgauge-out/SCENE")
    bench.add_argument("--quick", action="store_true", help="fewer samples and rounds, the same columns")
    bench.add_argument(
        "--budget",
        type=float,
        metavar="SECONDS",
        help="begin nothing after that (480, --quick 48; forward scenes 90, --quick 25)",
    )
    bench.add_argument("--contestants", metavar="A,B", help="families or contestants; default: all")
    bench.set_defaults(command=commands.bench)


def _add_stress(subparsers: Any, common: argparse.ArgumentParser) -> None:
    stress = subparsers.add_parser(
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
    stress.set_defaults(command=commands.stress)


if __name__ == "__main__":
    sys.exit(main())
