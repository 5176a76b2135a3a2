"""The command line. Only argparse is imported before a command is chosen."""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from screwgauge import commands
from screwgauge.commands import view
from screwgauge.commands.execution import check_current
from screwgauge.processes import fix_threads, save_time
from screwgauge.reference.errors import UnknownNameError, log_text
from screwgauge.report.console import console, report_end, say

DEFAULT_SCENE = "3ups-upu-s"
PURPOSE = "Do two descriptions of a mechanism's motion agree, by how much, and if not, why?"
GROUPS = {
    "use": ("run", "review", "diagnose", "casebook", "check", "import", "view"),
    "study": ("bench", "stress", "sweep", "identify", "matrix"),
    "export": ("models", "list"),
}
#: Command -> arguments of an example.
EXAMPLES = {
    "run": "slider-crank --quantities actuator_force,reaction",
    "review": "torques.csv slider-crank",
    "diagnose": "robot.urdf robot.xml --fix fixed.xml",
    "casebook": "mj-soft-floor",
    "check": "scenes/ --smoke --junit report.xml",
    "import": "robot.urdf --floating --out robot.toml",
    "view": "delta --out delta.html",
    "bench": "slider-crank --quick",
    "stress": "wrist-chart --severity 1e-3,1e-6",
    "sweep": "sweep.toml --out variants",
    "identify": "3ups-upu-s --out identified",
    "matrix": "--pin 3.9.0,4.1.0 --mujoco 4.0.0",
    "models": "delta --include geoms --check",
    "list": "scenes",
}
EXIT_STATUS = """exit status: 0 agreement within tolerance; 1 out of tolerance, not all compared, inertia left out, or
differences of a model file that are not allowed; 2 bad input or usage; 3 an engine failed or is missing, or the report
failed; 130, 143 stopped"""
STRESS_STATUS = """exit status: 0 every row is complete; 1 our own solver is silently wrong somewhere; 2 bad input;
3 a severity failed"""

NAMED = "built-in name, or path of a TOML, URDF, MJCF, SDF or USD file"
REVIEW_STATUS = "exit status: 0 all columns agree to their printed digits; 1 some do not; 2 bad input"
DIAGNOSE_STATUS = """exit status: 0 the same; 1 different, or not all compared; 2 bad input;
3 a library failed, or --limit was reached"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Returns:
        The exit status.
    """
    with console():
        try:
            return _command(arguments)
        except (Exception, KeyboardInterrupt) as error:
            return report_end(error, debug="--debug" in (sys.argv if arguments is None else arguments))


def _command(arguments: Sequence[str] | None) -> int:
    try:
        check_current(given := sys.argv[1:] if arguments is None else arguments)
        if not given:
            _parser().print_help()
            return 2
        options = _parse(given)
    finally:
        say("", end="")  # fail before any work if standard output is not writable
    fix_threads()
    save_time()
    os.environ["MUJOCO_GL"] = "disable"  # no rendering: MuJoCo would load libGL for it
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # raised by numpy; the report shows non-finite values
        try:
            return int(options.command(options))
        except SystemExit as error:  # raised by a library; its status would be mistaken for the command's
            raise RuntimeError(f"a library ended the program with status {error.code}") from error


def _parse(given: Sequence[str]) -> argparse.Namespace:
    """Parse a command line; for an unknown command or option, suggest the most similar one.

    Raises:
        UnknownNameError: The command is unknown, or lacks the option.
    """
    commands = [name for names in GROUPS.values() for name in names]
    named = not given[0].startswith("-")
    if named and given[0] not in commands:
        raise UnknownNameError("command", given[0], commands)
    options, rest = (parser := _parser()).parse_known_args(given)
    for option in (text.partition("=")[0] for text in rest if named and text.startswith("-")):
        raise UnknownNameError("option", option, options.known, given[0])
    if rest:
        parser.error(f"unrecognized arguments: {' '.join(rest)}")
    return options


def _whole_number(least: int) -> Callable[[str], int]:
    def number(text: str) -> int:
        if (value := int(text)) < least:
            raise argparse.ArgumentTypeError(f"{value} is less than {least}")
        return value

    return number


def _nonempty(text: str) -> str:
    """Reject an empty path, e.g. from an unset shell variable, because it would mean the current folder."""
    if not text:
        raise argparse.ArgumentTypeError("is empty; pass a file or folder, or omit it")
    return text


def _path(text: str) -> Path:
    return Path(_nonempty(text))


def _sides(text: str) -> str | list[str]:
    """Parse ``FILE``, or ``A,B``, where either may be empty."""
    return text.split(",") if "," in text and not Path(text).exists() else _nonempty(text)


class _Parser(argparse.ArgumentParser):
    """Parser that reports every error in one line."""

    def error(self, message: str) -> NoReturn:
        super().error(log_text(" ".join(message.split())))


class _Version(argparse.Action):
    """Action that prints the version, which is only looked up on request."""

    def __call__(self, parser: argparse.ArgumentParser, *given: Any) -> NoReturn:
        from screwgauge import __version__

        say(f"screwgauge {__version__}")
        parser.exit()


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="screwgauge", usage="%(prog)s COMMAND ...", formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    subparsers = parser.add_subparsers(prog="screwgauge", required=True, metavar="COMMAND", help=argparse.SUPPRESS)
    known: dict[str, str] = {}

    def command(run: Callable[[argparse.Namespace], int], help: str, out: str = "", epilog: str = "") -> Any:
        """Add a command; return the function that adds its arguments."""
        name = run.__name__.removesuffix("_")
        known[name] = help
        description = f"{help[0].upper()}{help[1:]}.\n\nexample: screwgauge {name} {EXAMPLES[name]}"
        texts: dict[str, Any] = {"description": description, "epilog": epilog}
        added = subparsers.add_parser(name, formatter_class=parser.formatter_class, **texts)
        added.add_argument("--debug", action="store_true", help="show the traceback of an error")
        if run not in (commands.list_, commands.casebook, commands.review):
            added.add_argument(
                "--force", action="store_true", help="overwrite inputs, and files that this command did not write"
            )
        if out:
            added.add_argument("-o", "--out", type=_path, metavar="DIR", help=f"default: screwgauge-out/{out}")
        added.set_defaults(command=run, known=added._option_string_actions)
        return added.add_argument

    def scene(add: Any) -> None:
        add("scene", nargs="?", default=DEFAULT_SCENE, metavar="SCENE", help=NAMED)

    def add_execution(add: Any, what: str) -> None:
        add("-j", "--jobs", type=int, metavar="N", help=f"{what} at a time (1)")
        add("--cluster", metavar="ADDRESS|FILE", help=f"run {what} on the Dask cluster of this scheduler")

    add = command(commands.list_, "list mechanisms, scenes, engines, quantities, cases or discrepancies")
    add("what", nargs="?", choices=["mechanisms", "scenes", "engines", "quantities", "cases", "discrepancies"])

    add = command(
        commands.models, "write URDF, MJCF and loops files of a mechanism for both loop cuts", out="MECHANISM/models"
    )
    add("mechanism", metavar="MECHANISM", help=f"{NAMED}; a scene provides its mechanism and gravity")
    add("--include", default="", metavar="A,B", help="add contacts, limits, geoms, sensors or yaml (a robot.yaml)")
    add(
        "--check",
        action="store_true",
        help="compare the readings of yourdfpy, Pinocchio and MuJoCo with the description",
    )

    add = command(
        commands.import_,
        "convert a model file, or a description with a rough home pose, to NAME.toml (description) and NAME.scene.toml",
    )
    add("file", type=_path, metavar="FILE", help="a model file, or a TOML file whose home pose is to be solved for")
    add(
        "--loops",
        type=_path,
        metavar="FILE",
        help="file with the loop closures: robot.yaml or NAME.loops.toml (default: the file next to it)",
    )
    add("-o", "--out", type=_path, metavar="NAME.toml", help="default: FILE.toml in this folder")
    add("--independent", metavar="A,B", help="coordinates (default: driven, and others for good conditioning)")
    add("--actuated", metavar="A,B", help="driven joints (default: as in the file)")
    add("--floating", action="store_true", help="let the base of a URDF move freely")
    meshes = "let MuJoCo compute mass and inertia from meshes in the folder of an MJCF"
    add("--meshes", action="store_true", help=meshes)
    add("--reader", choices=["pinocchio", "mujoco", "yourdfpy"], help="library that reads FILE (default: by format)")
    tensors = "accept impossible tensors, e.g. wrist.triangle, and files outside the folder, e.g. ../parts/"
    add("--allow", metavar="A,B", help=tensors)

    add = command(
        commands.run, "run the engines on a scene, compare them, and write the report", out="SCENE", epilog=EXIT_STATUS
    )
    scene(add)
    add("--engines", metavar="A,B", help="default: the scene's engines; screw@float32 computes in float32")
    add("--quantities", metavar="A,B", help="quantities to compute; default: all")
    add(
        "--exciting",
        action="store_true",
        help="replace the scene's motion with a motion that excites as much of the inertia as possible",
    )
    add("--seed", type=_whole_number(0), metavar="N", help="seed of the exciting motion (0)")
    values = "write times, positions and forces (or --quantities) as CSV: of the first engine, or of all to a folder"
    add("--csv", type=_path, metavar="FILE.csv|DIR", help=values)
    add("--allow", metavar="A,B", help=f"for a model file: {tensors}")
    add("--meshes", action="store_true", help=meshes)
    add("--samples", action="store_true", help="also write all samples (samples.parquet; needs pyarrow)")
    add("--pdf", action="store_true", help="also print the report to report.pdf (needs Chromium or Chrome)")
    add("--json", action="store_true", help="print the summary as JSON")
    add("--limit", type=float, metavar="SECONDS", help="stop an engine that takes longer (3600)")
    add("--memory", type=float, metavar="GB", help="stop an engine that needs more memory (the machine's memory)")

    add = command(commands.review, "find the faults in a table of numbers, column by column", epilog=REVIEW_STATUS)
    add("numbers", type=_path, metavar="NUMBERS", help="CSV or Parquet: t and components, named as in a run")
    add("scene", type=_nonempty, metavar="SCENE", help=f"scene that the numbers describe: {NAMED}")
    add("--quantities", metavar="A,B", help="quantities of the table, where column names are ambiguous")
    add("--json", action="store_true", help="print the review as JSON")

    add = command(view.view, "show a mechanism in 3D and in motion in a browser on this computer")
    which = "built-in scene or mechanism, or path of a TOML, URDF, MJCF, SDF or USD file"
    add("what", metavar="SCENE|MECHANISM|MODEL", help=which)
    add("other", nargs="?", metavar="OTHER", help="second mechanism, to show differences in the home pose")
    add("-o", "--out", type=_path, metavar="FILE.html", help="write the page to a file, and exit")
    for form in ("png", "svg", "pdf"):
        add(f"--{form}", type=_path, metavar=f"FILE.{form}", help="write a picture of the home pose, and exit")
    add("--port", type=int, metavar="N", help="default: a free port")

    add = command(commands.bench, "measure error against run time for many methods and settings", out="SCENE/bench")
    scene(add)
    add("--quick", action="store_true", help="use fewer samples and rounds, with the same columns")
    budget = "start no measurement after this time (480, --quick 48; simulated scenes 90, --quick 25)"
    add("--limit", type=float, metavar="SECONDS", help=budget)
    add("--contestants", metavar="A,B", help="families or contestants; default: all")
    add_execution(add, "contestants")

    add = command(
        commands.stress,
        "run stiff and extreme cases: show how many digits remain, and whether engines warn of lost digits",
        out="stress",
        epilog=STRESS_STATUS,
    )
    add("cases", nargs="*", metavar="CASE", help="default: all, see 'list cases'")
    add("--quick", action="store_true", help="use fewer severities and smaller scenes, with the same columns")
    add("--severity", metavar="A,B", help="severities to run, if a single case is named")
    add_execution(add, "severities")

    add = command(commands.sweep, "solve many variants of a scene, and rank its numbers by their effect", out="SWEEP")
    add(
        "plan",
        type=_path,
        metavar="SWEEP.toml",
        help="file with the scene, the numbers to vary, and how many variants to solve",
    )
    add_execution(add, "chunks of variants")

    add = command(
        commands.identify,
        "find out which numbers of a machine can be determined from its forces, and estimate them",
        out="SCENE/identify",
    )
    scene(add)
    add("--data", type=_path, metavar="FILE", help="CSV or Parquet: t, actuator forces, and the motion if it differs")
    add("--numbers", metavar="A,B", help="unknown numbers (all bodies, and resistances of actuated joints)")
    add(
        "--noise",
        type=float,
        metavar="SHARE",
        help="noise of the forces, relative to the largest force (estimated from data; 0.001)",
    )
    add("--prior", type=float, metavar="SHARE", help="relative uncertainty of the scene's numbers (0.1)")
    add("--seed", type=_whole_number(0), metavar="N", help="seed of the random rates (0)")
    add(
        "--fix",
        type=_path,
        metavar="FILE",
        help="write the numbers as a description (.toml), or into a copy of SCENE's URDF or MJCF",
    )

    add = command(
        commands.diagnose,
        "explain why two models of a machine differ, and prove the explanation",
        out="diagnosis",
        epilog=DIAGNOSE_STATUS,
    )
    which = "URDF, MJCF, SDF, USD or description (name or TOML); FILE@LIBRARY: as read by pinocchio, mujoco or yourdfpy"
    add("a", type=_nonempty, metavar="A", help=which)
    add("b", type=_nonempty, metavar="B", help="second model, in the same forms")
    add("--map", type=_path, metavar="FILE", help='TOML that pairs joints or bodies: "name in A" = "name in B"')
    add(
        "--loops",
        type=_sides,
        metavar="A,B",
        help="loop closures of URDFs, one file for both or two: robot.yaml or .loops.toml (default: next to the URDF)",
    )
    add("--meshes", action="store_true", help=meshes)
    add("--only", default="", metavar="rigid", help="compare only geometry, masses and inertias")
    add("--seed", type=_whole_number(0), default=0, metavar="N", help="seed of the random states (0)")
    add(
        "--limit",
        type=float,
        metavar="SECONDS",
        help="start no step after this time, and report the results so far (3600)",
    )
    add("--all", action="store_true", help="print each difference, not only the causes")
    add("--fix", type=_path, metavar="FILE", help="write a copy of B, corrected to agree with A")
    add("--json", action="store_true", help="print the summary as JSON")

    add = command(commands.casebook, "list named discrepancies between engines, or describe one in detail")
    add(
        "id",
        nargs="?",
        type=_nonempty,
        metavar="ID",
        help="show symptom, cause and remedy of this discrepancy, and affected versions",
    )

    add = command(
        commands.check,
        "check scenes or pairs of models against tolerances: a gate for CI",
        out="check",
        epilog=EXIT_STATUS,
    )
    add(
        "what",
        nargs="*",
        type=_nonempty,
        metavar="SCENE|FOLDER|MODEL",
        help="default: all built-in scenes; two model files form a pair",
    )
    add("--no-default", action="store_true", help="if nothing is named, fail instead of checking the built-in scenes")
    add("--smoke", action="store_true", help="use a few samples of an exciting motion, not of the scene's motion")
    add("--meshes", action="store_true", help=meshes)
    add("--tolerances", type=_path, metavar="FILE", help="TOML with quantity = scaled error (default: derived)")
    add(
        "--baseline",
        type=_path,
        metavar="FILE",
        help="file of an earlier check (JSON); fail if an error has grown since",
    )
    add("--update", action="store_true", help="write the result of this check as the new baseline")
    add("--junit", type=_path, metavar="FILE", help="also write JUnit XML")
    add_execution(add, "scenes")
    add("--json", action="store_true", help="print all results as JSON")
    add("--limit", type=float, metavar="SECONDS", help="stop a scene that takes longer (3600)")
    add("--memory", type=float, metavar="GB", help="stop a scene that needs more memory (the machine's memory)")

    add = command(
        commands.matrix,
        "repeat the check in fresh environments, one for each pair of versions",
        out="matrix",
        epilog=EXIT_STATUS,
    )
    add("--pin", metavar="A,B", help="versions of Pinocchio (the installed version)")
    add("--mujoco", metavar="A,B", help="versions of MuJoCo (the installed version)")
    add_execution(add, "pairs")
    parser.description = _overview(known)
    parser.epilog = EXIT_STATUS
    return parser


def _overview(known: Mapping[str, str]) -> str:
    """List the commands in their groups, one line each."""
    lines = [PURPOSE]
    for group, names in GROUPS.items():
        lines += ["", f"{group}:", *(f"  {name:<10}{known[name]}" for name in names)]
    return "\n".join([*lines, "", "For details run screwgauge COMMAND --help."])


if __name__ == "__main__":
    sys.exit(main())
