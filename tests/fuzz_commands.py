"""Runs commands on broken files, each in a process of its own: one sentence and a status, or an answer; nothing else.

    python tests/fuzz_commands.py --count 500           # of each kind; seeds from the clock, printed
    python tests/fuzz_commands.py --kinds baseline --count 1 --seed 17

Looked for are: what nobody foresaw, more than 60 s, more than 4 GB, a process that dies, signs that steer a terminal,
and anything written outside ``--out``. A process with all imports is forked for each case. Pictures are drawn in every
tenth case; libraries read models in the same process, and in one of their own only where they do not survive that.
"""

import argparse
import atexit
import importlib
import json
import os
import re
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path
from typing import Any

from fuzz_files import KINDS, Case, drawn, whole

from screwgauge.report import write as writing
from screwgauge.study import isolation
from support.command import main as command
from support.engines import unwatched

LIMIT, MEMORY = 60.0, 4.0  # s, GB
IMPORTED = ("mujoco", "pinocchio", "yourdfpy", "yaml", "pyarrow.parquet", "scipy.optimize", "scipy.integrate")
#: Of our own, that commands import when they need them.
OURS = (
    "diagnosis.diagnose",
    "report.pages.check",
    "report.pages.run",
    "report.pages.diagnosis",
)
UNFORESEEN = re.compile(
    r"should not have happened|Traceback|report could not be made|"
    r"\b(Key|Index|Type|Attribute|Assertion|Recursion|Overflow|UnicodeDecode|UnicodeEncode|Value|Memory)Error\b"
)


#: What a library says of a file that it refuses is its own.
LIBRARY = re.compile(r"(yourdfpy|pinocchio|mujoco) refuses it \(.*?\);", re.DOTALL)


def prepare() -> None:
    for name in (*IMPORTED, *(f"screwgauge.{one}" for one in OURS)):
        try:
            importlib.import_module(name)
        except ImportError:
            print(f"without {name}")
    # MuJoCo writes its log into the folder that it is used in
    importlib.import_module("mujoco").set_mju_user_warning(lambda text: None)


def _child(case: Case, folder: Path, *, separate: bool, draws: bool) -> None:
    """Becomes the command; never returns."""
    status = 99
    try:
        work = folder / "work"
        sys.dont_write_bytecode = True  # what is imported late may have its place elsewhere
        os.chdir(work)
        os.environ |= {"HOME": str(folder / "home"), "TMPDIR": str(folder / "tmp"), "PYTHONDONTWRITEBYTECODE": "1"}
        tempfile.tempdir = None
        for number, name in enumerate(("/dev/null", folder / "stdout", folder / "stderr")):
            os.dup2(os.open(name, os.O_RDWR | os.O_CREAT), number)
        resource.setrlimit(resource.RLIMIT_DATA, (int(MEMORY * 1e9),) * 2)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        _watch(folder)
        if not separate:
            isolation.run_isolated = unwatched
        if not draws:
            writing.page = lambda blocks: "<html></html>"
            writing.walk = lambda blocks: []
            from support.report import chart

            chart.picture = lambda *arguments, **more: writing.Picture("x", "x", "<svg ></svg>")
        status = command(list(case.command))
        atexit._run_exitfuncs()  # as Python does when it ends
        sys.stdout.flush()
        sys.stderr.flush()
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
    finally:
        os._exit(status)


def _watch(folder: Path) -> None:
    log = os.open(folder / "outside", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    inside = (str(folder), "/dev/", "/proc/self")

    def look(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open" and isinstance(arguments[0], str | bytes) and isinstance(arguments[2], int):
            name = os.path.abspath(os.fsdecode(arguments[0]))
            if arguments[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT) and not name.startswith(inside):
                os.write(log, f"{name}\n".encode(errors="backslashreplace"))

    sys.addaudithook(look)


def _ended(child: int) -> tuple[int | None, float]:
    descriptor = os.pidfd_open(child)
    ended = select.select([descriptor], [], [], LIMIT)[0]
    os.close(descriptor)
    if not ended:
        os.kill(child, signal.SIGKILL)
    _, status, used = os.wait4(child, 0)
    return status if ended else None, used.ru_maxrss * 1024 / 1e9


def _there(work: Path) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for path in sorted(work.rglob("*")):
        name = path.relative_to(work).as_posix()
        if name != "out" and not name.startswith("out/"):
            regular = (
                path.is_file() and not path.is_symlink() and path.stat().st_size < 10**8 and os.access(path, os.R_OK)
            )
            found[name] = path.read_bytes() if regular else path.lstat().st_mode
    return found


def outcome(case: Case, *, separate: bool = False, draws: bool = False) -> str:
    # one that goes away by itself would do so at the end of the child, too
    folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
    try:
        found = _outcome(case, folder, separate=separate, draws=draws)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    if found.startswith("WRONG signal") and not separate:
        return outcome(case, separate=True, draws=draws)  # in processes of their own, libraries may crash
    return found


def _outcome(case: Case, folder: Path, *, separate: bool, draws: bool) -> str:
    for each in ("work", "home", "tmp"):
        (folder / each).mkdir()
    case.write(folder / "work")
    before = _there(folder / "work")
    if not (child := os.fork()):
        _child(case, folder, separate=separate, draws=draws)
    status, memory = _ended(child)
    said = [(folder / each).read_text(encoding="utf-8", errors="replace") for each in ("stdout", "stderr")]
    outside = (folder / "outside").read_text() if (folder / "outside").exists() else ""
    after, left = _there(folder / "work"), [path.name for path in (folder / "tmp").iterdir()]
    if memory > MEMORY:
        return f"WRONG {memory:.1f} GB"
    if outside or after != before:
        changed = [each for each in {*after, *before} if after.get(each) != before.get(each)]
        return f"WRONG written: {outside} {sorted(changed)}"
    found = _judged(case, status, *said)
    if left and found.startswith("exit") and not separate:
        return f"WRONG left in the folder for temporary files: {left}"
    return found


def _judged(case: Case, status: int | None, out: str, errors: str) -> str:
    if status is None:
        return f"WRONG more than {LIMIT:g} s"
    if os.WIFSIGNALED(status):
        return f"WRONG signal {os.WTERMSIG(status)}: {errors[-500:]}"
    code = os.WEXITSTATUS(status)
    if match := UNFORESEEN.search(LIBRARY.sub("", out + errors)):
        return f"WRONG exit {code}, {match[0]}: {(errors or out)[-1500:]}"
    if code not in (0, 1, 2, 3):
        return f"WRONG exit {code}: {errors[-500:]}"
    if not all(sign.isprintable() or sign == "\n" for sign in out + errors):
        return f"WRONG exit {code}, not printable: {out + errors!r}"
    if code == 2 and not out and not re.fullmatch(r"(screwgauge: warning: .*\n)*screwgauge: .*\.\n", errors):
        return f"WRONG exit 2, no sentence: {errors!r}"
    if "--json" in case.command and out:
        try:
            json.loads(out)
        except ValueError:
            return f"WRONG exit {code}, no JSON: {out[:300]!r}"
    return f"exit {code}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=20, help="of each kind (20)")
    parser.add_argument("--seed", type=int, help="the first (from the clock)")
    parser.add_argument("--kinds", default=",".join(KINDS), help="some of these (all)")
    parser.add_argument("--verbose", action="store_true", help="say how each case ends")
    options = parser.parse_args()
    first = int(time.time()) if options.seed is None else options.seed
    print(f"seeds from {first}", flush=True)
    prepare()
    counts: Counter[tuple[str, str]] = Counter()
    for kind in options.kinds.split(","):
        begin, longest = time.monotonic(), 0.0
        for seed in range(first, first + options.count):
            case, since = drawn(kind, seed), time.monotonic()
            whole(case.mechanism)
            found = outcome(case, draws=seed % 10 == 0)
            longest = max(longest, time.monotonic() - since)
            counts[kind, found.partition(" ")[0] if found.startswith("WRONG") else found] += 1
            if found.startswith("WRONG") or options.verbose:
                print(f"{seed}: {case}: {found}", flush=True)
        print(f"{kind}: {time.monotonic() - begin:.0f} s, the longest {longest:.1f} s", flush=True)
    for (kind, found), count in sorted(counts.items()):
        print(f"{kind}\t{found}\t{count}")
    return int(any(found == "WRONG" for _, found in counts))


if __name__ == "__main__":
    sys.exit(main())
