"""An engine of another package that does what the name of its mechanism says, and then answers rightly, if it can."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import tomllib
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.engines.registry import Engine, EngineModel
from screwgauge.engines.screw import model as screw
from screwgauge.problem import GivenMotion, ModelFiles, Problem, Progress, quiet
from screwgauge.solution import Solution, Values

NAME, MARK = "harm", "code-of-an-answer"
ENGINE = Engine(NAME, "does harm", f"{__name__}:load", frozenset((GivenMotion,)), "screwgauge")


class _Code:
    def __reduce__(self):
        return os.mkdir, (os.path.abspath(MARK),)


class _Answer(Solution):
    def __reduce__(self):
        return os.mkdir, (os.path.abspath(MARK),)


class _Unread(Exception):
    def __init__(self, first, second):
        super().__init__(first)

    def __str__(self):
        raise ValueError("cannot be read")


def _raise(error):
    raise error


def _ignore_signals():
    for number in (signal.SIGTERM, signal.SIGALRM, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)


def _patch():
    import screwgauge.judging.compare as judged
    import screwgauge.study.methods as methods
    import screwgauge.study.run as compared

    judged.compare = compared.compare = methods.plain_answer = None
    np.abs = np.isfinite = lambda *_, **__: 0.0


def _write_into(problem):
    for array in (problem.task.y, problem.task.yd, problem.task.ydd):
        array.flags.writeable = True
        array *= 1.5


def _spin():
    while True:
        pass


def _turned(answer, change):
    values = {name: Values(one.components, one.units, change(one.array)) for name, one in answer.values.items()}
    return replace(answer, values=values)


#: What changes nothing for anybody else, and is followed by the right answer.
CHANGES = {
    "chdir": lambda problem: os.chdir("old"),
    "environ": lambda problem: os.environ.clear(),
    "errors": lambda problem: np.seterr(all="raise"),
    "signals": lambda problem: _ignore_signals(),
    "patch": lambda problem: _patch(),
    "prints": lambda problem: os.system("echo '::error::injected'; echo '::stop-commands::x' >&2"),
    "flood": lambda problem: os.write(1, b"x" * 5_000_000),
    "path": lambda problem: sys.path.clear(),
    "files": lambda problem: os.closerange(0, 1024),
    "forks": lambda problem: os.fork() or signal.pause(),
    "returns-twice": lambda problem: os.fork(),
    "thread": lambda problem: threading.Thread(target=_spin).start(),
    "inputs": _write_into,
}
#: What is no answer.
ENDS = {
    "exit": lambda problem: os._exit(0),
    "sys-exit": lambda problem: sys.exit(0),
    "interrupt": lambda problem: _raise(KeyboardInterrupt()),
    "base": lambda problem: _raise(BaseException("x")),
    "unread": lambda problem: _raise(_Unread(1, 2)),
    "abort": lambda problem: os.abort(),
    "free": lambda problem: ctypes.CDLL(None).free(ctypes.byref(ctypes.create_string_buffer(64), 32)),
    "address": lambda problem: ctypes.string_at(0),
    "stops": lambda problem: os.kill(os.getpid(), signal.SIGSTOP),
    "parent": lambda problem: os.kill(os.getppid(), signal.SIGKILL),
    "recursion": lambda problem: ENDS["recursion"](problem),
}
#: Answers that are none, or wrong.
ANSWERS = {
    "none": lambda answer: None,
    "code": lambda answer: _Code(),
    "sevenfold": lambda answer: _turned(answer, lambda x: 7.0 * x),
    "sign": lambda answer: _turned(answer, np.negative),
    "shifted": lambda answer: _turned(answer, lambda x: np.roll(x, 1, 0)),
    "not-a-number": lambda answer: _turned(answer, lambda x: x * np.nan),
    "map": lambda answer: _turned(answer, lambda x: np.memmap("map", dtype=float, mode="w+", shape=x.shape)),
    "no-values": lambda answer: replace(answer, values={}),
}
#: Right answers of odd types.
RIGHT = {
    "code-beside": lambda answer: _Answer(**{name: getattr(answer, name) for name in Solution.__dataclass_fields__}),
    "longdouble": lambda answer: _turned(answer, lambda x: x.astype(np.longdouble)),
}
MODES = (*CHANGES, *ENDS, *ANSWERS, *RIGHT)


def load(files: ModelFiles) -> Harm:
    return Harm(screw.load(files), tomllib.loads(files.model.read_text(encoding="utf-8"))["name"])


@dataclass(frozen=True)
class Harm:
    right: EngineModel
    mode: str

    def solve(self, problem: Problem, progress: Progress = quiet) -> object:
        answer = self.right.solve(problem)
        for acts in (CHANGES, ENDS):
            if self.mode in acts:
                acts[self.mode](problem)
        return {**ANSWERS, **RIGHT}.get(self.mode, lambda answer: answer)(answer)
