"""Changes the source at random places, one at a time, and sees who notices: the tests, or a run.

    python tests/mutants.py tests --count 120 --seed 0    # killed by the tests?
    python tests/mutants.py run --count 60 --seed 0       # noticed by `screwgauge run --exciting` on built-in scenes?

A mutant is an operator, a sign, a constant, an index, a transpose or a word like ``any`` exchanged in a function of
``reference/``, ``harness/engines/`` or ``harness/judging/``. Each is written into a copy of the package, so that the
checkout stays as it is. One line is printed for each; mutants that change nothing (equivalent ones) are for people to
tell.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import pickle
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("reference", "harness/engines", "harness/judging")
SWAPS: dict[type[ast.AST], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.Lt: ("<", ">="),
    ast.Gt: (">", "<="),
    ast.LtE: ("<=", ">"),
    ast.GtE: (">=", "<"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.And: ("and", "or"),
    ast.Or: ("or", "and"),
}
TEXT = (ast.Constant, ast.JoinedStr)
WORDS = {"any": "all", "all": "any", "max": "min", "min": "max", "sin": "cos", "cos": "sin", "argmax": "argmin"}
QUICK = 5.0  # s that a test takes at the most to be put to a mutant by ``--quick``
HUNG = 1800  # seconds
CHANGED = 1e-9  # share of the largest number of a scene


class Mutant(NamedTuple):
    """A place of the source, byte offsets, and what is to stand there."""

    file: Path
    line: int
    start: int
    end: int
    text: str

    def source(self) -> bytes:
        code = (ROOT / self.file).read_bytes()
        return code[: self.start] + self.text.encode() + code[self.end :]

    def __str__(self) -> str:
        lines = (ROOT / self.file).read_text(encoding="utf-8").splitlines()
        return f"{self.file}:{self.line}: {lines[self.line - 1].strip()}  ->  {self.text}"


def mutants(file: Path) -> Iterator[Mutant]:
    """All that can be made of a file."""
    code = (ROOT / file).read_bytes()
    starts = [0]
    for line in code.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def begin(node: ast.expr) -> int:
        return starts[node.lineno - 1] + node.col_offset

    def end(node: ast.expr) -> int:
        return starts[(node.end_lineno or 0) - 1] + (node.end_col_offset or 0)

    def made(node: ast.expr, text: str) -> Mutant:
        return Mutant(file, node.lineno, begin(node), end(node), text)

    def between(left: ast.expr, op: ast.AST, right: ast.expr) -> Mutant:
        old, new = SWAPS[type(op)]
        return Mutant(
            file, left.lineno, end(left), begin(right), code[end(left) : begin(right)].decode().replace(old, new)
        )

    tree = ast.parse(code)
    quiet = {id(each.value) for each in ast.walk(tree) if isinstance(each, ast.keyword) and each.arg == "strict"}
    for function in (each for each in ast.walk(tree) if isinstance(each, ast.FunctionDef)):
        for node in (each for statement in function.body for each in ast.walk(statement) if id(each) not in quiet):
            match node:
                case ast.BinOp(left, op, right) if type(op) in SWAPS and not isinstance(
                    left, ast.Constant | ast.JoinedStr
                ):
                    yield between(left, op, right)
                case ast.Compare(left, [op], [right]) | ast.BoolOp(op, [left, right]) if type(op) in SWAPS:
                    yield between(left, op, right)
                case ast.UnaryOp(ast.USub() | ast.Not(), operand):
                    yield made(node, ast.unparse(operand))
                case ast.Constant(bool() as value):
                    yield made(node, str(not value))
                case ast.Constant(int() as value):
                    yield made(node, str(value + 1))
                case ast.Constant(float() as value) if value:
                    yield made(node, repr(1.3 * value))
                case ast.Attribute(value, "T") | ast.Call(ast.Attribute(value, "swapaxes")):
                    yield made(node, ast.unparse(value))
                case ast.Attribute(value, name) if name in WORDS:
                    yield made(node, f"{ast.unparse(value)}.{WORDS[name]}")
                case ast.Name(name, ast.Load()) if name in WORDS:
                    yield made(node, WORDS[name])


def sources() -> list[Path]:
    """Files of the rooms, from the root of the checkout."""
    return [path.relative_to(ROOT) for room in ROOMS for path in sorted((ROOT / room).rglob("*.py"))]


def drawn(count: int, seed: int, lines: set[tuple[Path, int]] | None = None) -> list[Mutant]:
    """So many mutants, all rooms alike by their size; of some lines only, if these are given."""
    every = dict.fromkeys(one for file in sources() for one in mutants(file))
    known = [one for one in every if lines is None or (one.file, one.line) in lines]
    return random.Random(seed).sample(known, min(count, len(known)))


def package(folder: Path) -> Path:
    """A copy of the package as it is installed."""
    shutil.copytree(ROOT / "harness", folder / "screwgauge", ignore=shutil.ignore_patterns("__pycache__"))
    for room in ("reference", "models"):
        shutil.copytree(ROOT / room, folder / "screwgauge" / room, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def installed(folder: Path, file: Path) -> Path:
    """Where a file of the checkout is in the copy."""
    return folder / "screwgauge" / (file.relative_to("harness") if file.parts[0] == "harness" else file)


def execute(folder: Path, *command: str) -> subprocess.CompletedProcess[str] | None:
    """Python in the copy; None if it took too long."""
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        return subprocess.run(
            [sys.executable, *command], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=HUNG
        )
    except subprocess.TimeoutExpired:
        return None


def covering(folder: Path) -> Callable[[Mutant], list[tuple[float, str]]]:
    """Runs all tests once; gives the tests that execute the line of a mutant, the shortest first, with their times [s].

    What a fixture executes is seen by all tests of its file.
    """
    from coverage import CoverageData

    said, settings = folder / "tests.xml", folder / "coveragerc"
    settings.write_text(f"[run]\nsource_pkgs = screwgauge\ndata_file = {folder / 'coverage'}\n", encoding="utf-8")
    how = f"--cov=screwgauge --cov-config={settings} --cov-context=test --cov-report= --junit-xml={said}".split()
    done = execute(folder, "-m", "pytest", "-p", "no:cacheprovider", *how)
    assert done is not None
    assert done.returncode == 0, done.stdout[-2000:]
    times = {}
    for case in ET.parse(said).iter("testcase"):
        times[f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name')}"] = float(case.get("time", 0))
    data = CoverageData(str(folder / "coverage"))
    data.read()

    def tests(mutant: Mutant) -> list[tuple[float, str]]:
        lines = data.contexts_by_lineno(str(installed(folder, mutant.file)))
        before = [line for line in lines if line <= mutant.line]  # the first line of what goes over several
        names: set[str] = set()
        for context in lines[max(before)] if before else ():
            name, _, phase = context.partition("|")
            file = name.partition("::")[0] + "::"
            names |= {one for one in times if one.startswith(file)} if phase == "setup" else {name} & times.keys()
        return sorted((times[name], name) for name in names)

    return tests


def by_tests(folder: Path, tests: list[tuple[float, str]]) -> str:
    """The test that notices, or ``survived``."""
    if not tests:
        return "survived: no test executes it"
    listed = folder / "listed"
    listed.write_text("\n".join(name for _, name in tests), encoding="utf-8")
    done = execute(folder, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", f"@{listed}")
    if done is None:
        return "hangs"
    if not done.returncode:
        return f"survived {len(tests)} tests"
    said = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return said[0].partition(" - ")[0] if said else (done.stdout + done.stderr).strip().splitlines()[-1]


def executed(folder: Path, *options: str) -> dict[str, Any] | None:
    """What a run of all scenes in the copy gives; None if it breaks, which nobody can overlook."""
    file = folder / "found.json"
    file.unlink(missing_ok=True)
    done = execute(folder, __file__, "scenes", "--out", str(file), *options)
    return json.loads(file.read_text()) if done is not None and file.exists() else None


def scenes(out: Path, *, trace: bool) -> None:
    """Runs all built-in scenes of given motions, excited, at a few samples: verdicts, values, and lines if wanted."""
    import screwgauge
    from screwgauge.scene.read import scene_names

    lines: set[tuple[str, int]] = set()
    rooms = tuple(str(installed(Path(screwgauge.__file__).parents[1], Path(room))) for room in ROOMS)

    def follow(frame: FrameType, event: str, argument: object) -> Any:
        if not frame.f_code.co_filename.startswith(rooms):
            return None
        lines.add((frame.f_code.co_filename, frame.f_lineno))
        return follow

    given = [scene for scene in map(screwgauge.load_scene, scene_names()) if not scene.simulated]
    kept = out.with_name("motions.pickle")  # to find them takes as long as the runs
    if not kept.exists():
        motions = {scene.name: (excited := screwgauge.exciting(scene)).at(excited.t[10::30]).motion for scene in given}
        kept.write_bytes(pickle.dumps(motions))
    motions = pickle.loads(kept.read_bytes())
    sys.settrace(follow if trace else None)
    found: dict[str, Any] = {}
    for scene in map(screwgauge.load_scene, scene_names()):
        if not scene.simulated:
            results = screwgauge.run(replace(scene, task=motions[scene.name]))
            values = [s.values[q].array.ravel() for s in results.solutions.values() for q in sorted(s.values)]
            found[scene.name] = {
                "exit": results.exit_status,
                "values": np.concatenate(values or [np.zeros(1)]).tolist(),
            }
    sys.settrace(None)
    out.write_text(json.dumps({"scenes": found, "lines": sorted(lines)}))


def by_run(folder: Path, right: dict[str, Any]) -> str:
    """Whether a run notices, and whether there is something to notice."""
    found = executed(folder)
    if found is None:
        return "noticed: it breaks"
    pairs = [(found["scenes"][name], right["scenes"][name]) for name in right["scenes"]]
    change = max(_apart(one["values"], other["values"]) for one, other in pairs)
    noticed = [name for name, (one, _) in zip(right["scenes"], pairs, strict=True) if one["exit"]]
    if noticed:
        return f"noticed in {len(noticed)} scenes, numbers change by {change:.1g}"
    return f"MISSED, numbers change by {change:.1g}" if change > CHANGED else f"nothing changes ({change:.1g})"


def _apart(one: list[float], other: list[float]) -> float:
    """Largest change of a number, over the largest of its scene; numbers that come or go are a change."""
    if len(one) != len(other):
        return float("inf")
    a, b = (np.nan_to_num(np.array(values), nan=1e300) for values in (one, other))
    return float(np.abs(a - b).max() / np.nanmax(np.abs(other)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("who", choices=["tests", "run", "scenes"])
    parser.add_argument("--count", type=int, default=120)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--skip", type=int, default=0, help="so many of them were done before")
    parser.add_argument("--quick", action="store_true", help=f"without the tests that take {QUICK:g} s")
    parser.add_argument("--out", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--trace", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.who == "scenes":
        scenes(options.out, trace=options.trace)
        return
    with tempfile.TemporaryDirectory() as name:
        folder = package(Path(name))
        lines, right, tests = None, None, None
        if options.who == "tests":
            tests = covering(folder)
        else:
            right = executed(folder)
            traced = executed(folder, "--trace")
            assert right is not None
            assert traced is not None
            homes = {str(installed(folder, file)): file for file in sources()}
            lines = {(homes[file], line) for file, line in traced["lines"] if file in homes}
        for mutant in drawn(options.count, options.seed, lines)[options.skip :]:
            target = installed(folder, mutant.file)
            kept = target.read_bytes()
            target.write_bytes(mutant.source())
            if tests is not None:
                found = by_tests(folder, [one for one in tests(mutant) if not options.quick or one[0] < QUICK])
            else:
                assert right is not None
                found = by_run(folder, right)
            print(f"{found}\t{mutant}", flush=True)
            target.write_bytes(kept)


if __name__ == "__main__":
    main()
