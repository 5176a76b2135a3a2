"""An engine of another package that prints, and whose answers are the solver's with something wrong about them."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.engines.registry import Engine, EngineModel
from screwgauge.engines.screw import model as screw
from screwgauge.problem import GivenMotion, ModelFiles, Problem, Progress, quiet
from screwgauge.solution import Error, Solution, Values

print("imported")
ENGINE = Engine("loud", "prints", f"{__name__}:load", frozenset((GivenMotion,)), "screwgauge")
IMPOSTOR = replace(ENGINE, name="screw")
FAILS = replace(ENGINE, source=f"{__name__}:load_failing")
NO_ENGINE = {"name": "loud"}
LONG = "x" * 100_000_000


def load(files: ModelFiles) -> Loud:
    return Loud(screw.load(files))


@dataclass(frozen=True)
class Loud:
    right: EngineModel

    def solve(self, problem: Problem, progress: Progress = quiet) -> Solution:
        print("solving", flush=True)
        os.write(1, b"in C\n")
        return replace(self.right.solve(problem, progress), notes=(LONG,))


def load_failing(files: ModelFiles) -> Failing:
    return Failing()


class Failing:
    """Prints, and fails."""

    def solve(self, problem: Problem, progress: Progress = quiet) -> Solution:
        print("solving")
        raise ValueError("no idea")


class UnreadableError(Exception):
    def __str__(self) -> str:
        raise ValueError("cannot be read")


def _array(change):
    def changed(answer: Solution) -> Solution:
        found = answer.values["joint_position"]
        values = Values(found.components, found.units, change(found.array))
        return replace(answer, values={**answer.values, "joint_position": values})

    return changed


def _renamed(**changes):
    def changed(answer: Solution) -> Solution:
        found = answer.values["joint_position"]
        values = Values(**{"components": found.components, "units": found.units, "array": found.array, **changes})
        return replace(answer, values={**answer.values, "joint_position": values})

    return changed


def _with(**changes):
    return lambda answer: replace(answer, **changes)


#: What is wrong with an answer -> a word of what is said of it.
WRONG = {
    "complex": (_array(lambda x: x.astype(complex)), "complex128"),
    "object": (_array(lambda x: x.astype(object)), "object"),
    "text": (_array(lambda x: x.astype(str)), "real numbers"),
    "truth values": (_array(lambda x: x > 0), "bool"),
    "dates": (_array(lambda x: x.astype("datetime64[s]")), "datetime64"),
    "masked": (_array(np.ma.masked_invalid), "MaskedArray"),
    "no values": (_with(values={"joint_position": 3}), "not Values"),
    "no mapping": (_with(values=[1]), "not a mapping"),
    "unknown quantity": (lambda a: replace(a, values={**a.values, "x" * 1000: a.values["joint_position"]}), "quantity"),
    "doubled names": (_renamed(components=("a",) * 26), "the same name"),
    "names that are none": (_renamed(components=(None,) * 26), "NoneType"),
    "other units": (_renamed(units=("furlong",) * 26), "furlong"),
    "condition": (_with(condition="large"), "condition"),
    "condition of one": (_with(condition=np.ones(1)), "condition"),
    "condition in words": (_with(condition=np.array(["a", "b"])), "condition"),
    "error": (_with(errors={"joint_position": Error(np.zeros((2, 2)))}), "error"),
    "error in words": (_with(errors={"joint_position": Error(np.array(["a", "b"]))}), "error"),
    "error below zero": (_with(errors={"joint_position": Error(-np.ones(2))}), "negative"),
    "condition below zero": (_with(condition=-np.ones(2)), "negative"),
    "condition of one quantity": (_with(errors={"joint_position": Error(np.zeros(2), condition="large")}), "condition"),
    "radius": (_with(errors={"joint_position": Error(np.zeros(2), radius=np.zeros(3))}), "radius"),
    "assembly": (_with(assembly=np.zeros((7, 26))), "assembly"),
    "assembly too small": (_with(assembly=np.zeros((2, 1))), "assembly"),
    "rows": (_with(rows=np.array([0, 9])), "rows"),
    "rows twice": (_with(rows=np.array([1, 1])), "rows"),
    "work": (_with(work=np.zeros((2, 3))), "work"),
    "no error": (_with(errors={"joint_position": 1.0}), "not Error"),
    "errors": (_with(errors=7), "errors"),
    "absolute errors": (_with(errors={"joint_position": Error(np.zeros(2), absolute=1.0)}), "error of joint_position"),
    "absolute errors in words": (_with(errors={"joint_position": Error(np.zeros(2), {"rad": "much"})}), "much"),
    "absolute errors below zero": (_with(errors={"joint_position": Error(np.zeros(2), {"rad": -1.0})}), "negative"),
    "an absolute error that is none": (_with(errors={"joint_position": Error(np.zeros(2), {"rad": np.nan})}), "nan"),
    "timings": (_with(timings=("fast",)), "timing"),
    "cost": (_with(cost="nothing"), "cost"),
    "notes": (_with(notes=(1, 2)), "int"),
    "a note": (_with(notes="note"), "notes"),
    "notes without end": (_with(notes=("note",) * 100_000), "100000 notes"),
    "warnings": (_with(warnings=(b"x",)), "bytes"),
    "version": (_with(version=3), "string"),
    "setting": (_with(setting=None), "string"),
    "stopped": (_with(stopped=1), "string"),
}
