"""What every study does with a method: ask it, and turn whatever it raises into a failure with its reason."""

from __future__ import annotations

import traceback
from pathlib import Path
from time import perf_counter

from screwgauge.engines.registry import get_engine
from screwgauge.problem import ModelFiles, Problem, Progress, quiet
from screwgauge.solution import Failure, Solution
from screwgauge.study.ask import missing
from screwgauge.study.method import Method


class TooLongError(Exception):
    """A method that was stopped, as it took too long."""


def within(seconds: float) -> Progress:
    """A progress that stops a method which takes longer than so many seconds, counted from now.

    Raises:
        TooLongError: When it is called too late.
    """
    begin = perf_counter()

    def progress(share: float) -> None:
        if perf_counter() - begin > seconds:
            raise TooLongError(f"stopped after {seconds:.3g} s, {share:.0%} of the way")

    return progress


def ask(method: Method, files: ModelFiles, problem: Problem, progress: Progress = quiet) -> Solution | Failure:
    """Loads a model and puts a problem to it; only being stopped is raised."""
    try:
        return method.load(files).solve(problem, progress)
    except TooLongError:
        raise
    except Exception as error:
        where = "".join(traceback.format_exception(error))
        return Failure(method.name, failure_text(error, method, files.model.parent), where)


def failure_text(error: Exception, method: Method, folder: Path) -> str:
    """An error in one line, without the folder of generated files, which goes when the work is done."""
    if isinstance(error, ImportError):
        return missing(error, get_engine(method.engine))
    return f"{type(error).__name__}: {' '.join(str(error).split()).replace(f'{folder}/', '')}"
