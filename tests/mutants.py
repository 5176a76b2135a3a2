"""Changes the source at random places, one at a time, and sees who notices: the tests, or the golden numbers.

    python tests/mutants.py tests --count 120 --seed 0    # killed by the tests?
    python tests/mutants.py golden --count 40 --seed 0    # of those that change a number: noticed by tests/golden?
    python tests/mutants.py list --count 60 --seed 53     # writes them as TOML, for planted.py --list

A mutant is an operator, a sign, a constant, an index, a transpose or a word like ``any`` exchanged in a function of
`ROOMS`, on a line that those tests execute. Each is written into a copy of the package, so that the checkout stays as
it is. One line is printed for each. Mutants that change nothing (equivalent ones) are for people to tell; those that
golden numbers overlook are looked at by `witness`: the same kinds of facts of other scenes, seeds, rungs and edits. A
mutant counts as one that changes a number if any of these is off by more than a twentieth of what golden numbers admit.
"""

import argparse
import ast
import os
import pickle
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np
import tomli_w

ROOT = Path(__file__).resolve().parents[1]
INSIDE = ("engines", "judging", "truth", "witness", "scene", "study", "diagnosis", "report", "commands")
ROOMS = ("reference", *(f"harness/{room}" for room in INSIDE), "models")
GOLDEN = "tests/golden/test_golden.py"
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
CHANGED = 0.05  # of what golden numbers may be off by


class Mutant(NamedTuple):
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
    """Yield all mutants of a file."""
    code = (ROOT / file).read_bytes()
    starts = [0]
    for line in code.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def begin(node: ast.expr) -> int:
        return starts[node.lineno - 1] + node.col_offset

    def end(node: ast.expr) -> int:
        return starts[(node.end_lineno or 0) - 1] + (node.end_col_offset or 0)

    tree = ast.parse(code)
    quiet = {id(each.value) for each in ast.walk(tree) if isinstance(each, ast.keyword) and each.arg == "strict"}
    for function in (each for each in ast.walk(tree) if isinstance(each, ast.FunctionDef)):
        for node in (each for statement in function.body for each in ast.walk(statement) if id(each) not in quiet):
            if (sides := _swapped(node)) is not None:
                left, (old, new), right = sides
                text = code[end(left) : begin(right)].decode().replace(old, new)
                yield Mutant(file, left.lineno, end(left), begin(right), text)
            elif isinstance(node, ast.expr) and (text := _rewritten(node)) is not None:
                yield Mutant(file, node.lineno, begin(node), end(node), text)


def _swapped(node: ast.AST) -> tuple[ast.expr, tuple[str, str], ast.expr] | None:
    match node:
        case ast.BinOp(ast.Constant() | ast.JoinedStr()):
            return None
        case ast.BinOp(left, op, right) | ast.Compare(left, [op], [right]) | ast.BoolOp(op, [left, right]):
            return (left, SWAPS[type(op)], right) if type(op) in SWAPS else None
    return None


def _rewritten(node: ast.expr) -> str | None:
    match node:
        case ast.UnaryOp(ast.USub() | ast.Not(), operand):
            return ast.unparse(operand)
        case ast.Constant(value):
            return _another(value)
        case ast.Attribute(value, "T") | ast.Call(ast.Attribute(value, "swapaxes")):
            return ast.unparse(value)
        case ast.Attribute(value, name) if name in WORDS:
            return f"{ast.unparse(value)}.{WORDS[name]}"
        case ast.Name(name, ast.Load()) if name in WORDS:
            return WORDS[name]
    return None


def _another(value: object) -> str | None:
    match value:
        case bool():
            return str(not value)
        case int():
            return str(value + 1)
        case float() if value:
            return repr(1.3 * value)
    return None


def drawn(count: int, seed: int) -> list[Mutant]:
    files = {room: [path.relative_to(ROOT) for path in sorted((ROOT / room).rglob("*.py"))] for room in ROOMS}
    lines = {room: sum(map(_code_lines, every)) for room, every in files.items()}
    shares = {room: count * each / sum(lines.values()) for room, each in lines.items()}
    missing = count - sum(map(int, shares.values()))
    larger = sorted(ROOMS, key=lambda room: shares[room] % 1.0, reverse=True)[:missing]
    chance = random.Random(seed)
    found = []
    for room in ROOMS:
        every = [*dict.fromkeys(one for file in files[room] for one in mutants(file))]
        found += chance.sample(every, min(int(shares[room]) + (room in larger), len(every)))
    chance.shuffle(found)
    return found


def _code_lines(file: Path) -> int:
    lines = (ROOT / file).read_text(encoding="utf-8").splitlines()
    return sum(bool(line.strip()) and not line.lstrip().startswith("#") for line in lines)


def listed(mutant: Mutant) -> dict[str, str]:
    code = (ROOT / mutant.file).read_bytes()
    start, end = code.rfind(b"\n", 0, mutant.start) + 1, code.find(b"\n", mutant.end)
    while code.count(code[start:end].strip()) > 1:
        start = code.rfind(b"\n", 0, start - 1) + 1
    start = end - len(code[start:end].lstrip())
    planted = code[start : mutant.start] + mutant.text.encode() + code[mutant.end : end]
    (room,) = (room for room in ROOMS if mutant.file.is_relative_to(room))
    return {"room": room, "file": str(mutant.file), "line": code[start:end].decode(), "planted": planted.decode()}


def package(folder: Path) -> Path:
    shutil.copytree(ROOT / "harness", folder / "screwgauge", ignore=shutil.ignore_patterns("__pycache__"))
    for room in ("reference", "models"):
        shutil.copytree(ROOT / room, folder / "screwgauge" / room, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def installed(folder: Path, file: Path) -> Path:
    return folder / "screwgauge" / (file.relative_to("harness") if file.parts[0] == "harness" else file)


def execute(folder: Path, *command: str) -> subprocess.CompletedProcess[str] | None:
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        return subprocess.run(
            [sys.executable, *command], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=HUNG
        )
    except subprocess.TimeoutExpired:
        return None


def covering(folder: Path, *which: str) -> Callable[[Mutant], list[tuple[float, str]]]:
    """Runs all tests, or some, once; gives those that execute the line of a mutant, the shortest first.

    Times are in s. What a fixture executes is seen by all tests of its file.
    """
    from coverage import CoverageData

    times_file, settings = folder / "tests.xml", folder / "coveragerc"
    settings.write_text(f"[run]\nsource_pkgs = screwgauge\ndata_file = {folder / 'coverage'}\n", encoding="utf-8")
    how = f"--cov=screwgauge --cov-config={settings} --cov-context=test --cov-report= --junit-xml={times_file}".split()
    done = execute(folder, "-m", "pytest", "-p", "no:cacheprovider", *how, *which)
    assert done is not None
    assert done.returncode == 0, done.stdout[-2000:]
    times = {}
    for case in ET.parse(times_file).iter("testcase"):
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
    if not tests:
        return "survived: no test executes it"
    listed = folder / "listed"
    listed.write_text("\n".join(name for _, name in tests), encoding="utf-8")
    done = execute(folder, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", f"@{listed}")
    if done is None:
        return "hangs"
    if not done.returncode:
        return f"survived {len(tests)} tests"
    failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return failed[0].partition(" - ")[0] if failed else (done.stdout + done.stderr).strip().splitlines()[-1]


def looked_at() -> Iterator[tuple[str, str]]:
    yield from (("random", str(seed)) for seed in range(1000, 1040, 5))
    yield from (("random", str(seed)) for seed in range(1001, 1025, 2))
    yield from (("diagnoses", f"edit {number}") for number in range(200, 233, 3))
    yield from (("stress", f"{case} quick") for case in ("upu-singularity 0.003", "u-lock 1e-5", "load 3e4"))
    yield from (("stress", f"{case} quick") for case in ("proximal 1e-5", "scale 0.03", "closure-violation 1e-6"))
    yield from (("compiled", f"{name} llvm") for name in ("five-bar", "3-rrr", "planetary-gear"))
    yield from (("proved", name) for name in ("3-rrr", "delta", "double-cardan"))
    for name in ("3ups-upu-s-fast", "stewart-legs", "planetary-gear", "springs", "screw-press"):
        yield from ((part, name) for part in ("scenes", "wrong"))
    yield from (("simulations", name) for name in ("falls", "falls-radau", "a05-governor", "a04-bricard-box"))


def witness(out: Path) -> None:
    sys.path.insert(0, str(ROOT / "tests"))
    from golden.kept import PARTS

    facts: dict[tuple[str, str], Any] = {}
    for part, case in looked_at():
        with np.errstate(all="ignore"):
            try:
                facts[part, case] = dict(PARTS[part].facts(case))
            except Exception as error:  # a mutant may break anything
                facts[part, case] = type(error).__name__
    out.write_bytes(pickle.dumps(facts))


def witnessed(folder: Path) -> Any:
    file = folder / "witness.pickle"
    file.unlink(missing_ok=True)
    done = execute(folder, __file__, "witness", "--out", str(file))
    return pickle.loads(file.read_bytes()) if done is not None and file.exists() else None


def change(answer: Any, right: Any) -> str:
    if answer is None:
        return "it breaks"
    for which, known in right.items():
        now = answer[which]
        if isinstance(now, str) or isinstance(known, str):
            if now != known:
                return f"{' '.join(which)} ends in another way"
            continue
        if now.keys() != known.keys():
            return f"{' '.join(which)} has other rows"
        for key, fact in now.items():
            if not fact.within(known[key], CHANGED):
                return f"{' '.join(which)}, {key}: {fact}, not {known[key]}"
    return ""


def overlooked(folder: Path, right: Any) -> str:
    """Describe what golden numbers missed."""
    changed = change(witnessed(folder), right)
    return f"MISSED: {changed}" if changed else "nothing changes"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("who", choices=["tests", "golden", "list", "witness"])
    parser.add_argument("--count", type=int, default=120, help="mutants; of golden: those that change a number")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--skip", type=int, default=0, help="so many of them were done before")
    parser.add_argument("--quick", action="store_true", help=f"without the tests that take {QUICK:g} s")
    parser.add_argument("--out", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.who == "witness":
        witness(options.out)
        return
    if options.who == "list":
        every = [listed(mutant) for mutant in drawn(options.count, options.seed)]
        sys.stdout.write(tomli_w.dumps({"mistakes": every}, multiline_strings=True))
        return
    with tempfile.TemporaryDirectory() as name:
        folder, golden = package(Path(name)), options.who == "golden"
        tests = covering(folder, *([GOLDEN, "-m", "not slow"] if golden else []))
        right = witnessed(folder) if golden else None
        changing = 0
        for mutant in drawn(10 * options.count if golden else options.count, options.seed)[options.skip :]:
            able = [one for one in tests(mutant) if not options.quick or one[0] < QUICK]
            if changing == options.count or (golden and not able):
                continue
            target = installed(folder, mutant.file)
            kept = target.read_bytes()
            target.write_bytes(mutant.source())
            verdict = by_tests(folder, able)
            if golden and verdict.startswith("survived"):
                verdict = overlooked(folder, right)
            changing += verdict != "nothing changes"
            print(f"{verdict}\t{mutant}", flush=True)
            target.write_bytes(kept)


if __name__ == "__main__":
    main()
