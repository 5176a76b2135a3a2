"""A million samples at constant memory, and what an integrated scheme has drifted by then."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from screwgauge.engines.screw.scheme import PARTS, chains, march, platform_screws
from screwgauge.judging.answer import timed
from screwgauge.problem import ModelFiles, Problem, Progress, quiet
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.graph import layout
from screwgauge.reference.rotations import Array
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution, Stopwatch, Values, empty
from screwgauge.study.cases.asking import SCENE
from screwgauge.study.cases.question import Question
from screwgauge.study.methods import Method
from screwgauge.study.reference import joined, reference_values
from screwgauge.study.stream import stream, times

STEP = 1e-3  # [s] between samples
SCHEME_STEP = 1e-2  # [s] of the paper's scheme
PART = 2048  # steps of the scheme at a time
CHECKED = 8  # samples at which the truth is asked, the last among them
QUANTITIES = ("joint_position", "generalized_force")
SCHEMES = {
    "paper Euler": ("euler", "steps of eq. (27): an error of first order that nothing corrects or estimates"),
    "paper RK4": ("rk4", "an error of fourth order that nothing corrects or estimates"),
}


def long_run(count: float, quick: bool, folder: Path) -> Iterator[Question]:
    """The default scene for as long as so many samples take."""
    scene = replace(load_scene(SCENE), rule="min_norm")
    at = _checked(int(count)) * STEP
    files, right = ModelFiles(scene.mechanism_file), reference_values(scene, at, QUANTITIES)
    streamed, problem = Streamed("screw", scene=scene, count=int(count)), scene.at(at).problem(QUANTITIES)
    engines = {"screw": files, "paper": files}
    whole = Question(scene.mechanism, engines, problem, (streamed,), QUANTITIES, right)
    yield whole
    posed = replace(problem, wanted=frozenset(QUANTITIES[:1]))
    for label, (method, cause) in SCHEMES.items():
        scheme = PaperScheme("paper", {"method": method}, label, scene=scene)
        yield replace(whole, problem=posed, methods=(scheme,), quantities=QUANTITIES[:1], cause=cause)


def _checked(count: int) -> Array:
    """Numbers of samples, from 1, that the scheme meets too; the last among them."""
    stride = round(SCHEME_STEP / STEP)
    return np.unique(np.geomspace(1, count // stride, CHECKED).round().astype(int)) * stride


@dataclass(frozen=True, slots=True, kw_only=True)
class Streamed(Method):
    """An engine on all samples of a scene, part by part; it answers at those that are asked."""

    scene: Scene
    count: int

    def load(self, files: ModelFiles) -> Streamed:
        return self

    def solve(self, problem: Problem, progress: Progress = quiet) -> Solution:
        """Values at the times asked, which are some of the samples."""
        clock, at = Stopwatch(), np.rint(timed(problem).t / STEP).astype(int)
        parts: dict[str, list[Values]] = {name: [] for name in sorted(problem.wanted)}
        worst, done, version = 0.0, 0, ""
        grid = times(self.count, STEP, first=STEP)
        for t, solution in stream(self.scene, grid, engine=self.engine, quantities=problem.wanted):
            rows = at[(at > done) & (at <= done + len(t))] - done - 1
            for name, kept in parts.items():
                kept.append(solution.values[name].at(rows))
            worst, done, version = max(worst, float(solution.condition.max())), done + len(t), solution.version
        values = {name: joined(kept) for name, kept in parts.items()}
        return Solution(self.engine, version, values, np.full(len(at), worst), cost=clock.cost())


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperScheme(Method):
    """The paper's own scheme, its twist set right, in steps of `SCHEME_STEP`."""

    scene: Scene

    def load(self, files: ModelFiles) -> PaperScheme:
        return self

    def solve(self, problem: Problem, progress: Progress = quiet) -> Solution:
        """Joint positions at the times asked, at which steps end."""
        clock, mechanism, method = Stopwatch(), self.scene.mechanism, str(self.settings["method"])
        lay = layout(mechanism)
        side, parts = chains(lay), PARTS[method]
        ends = np.rint(timed(problem).t / SCHEME_STEP).astype(int)
        first = np.zeros(1)
        theta = side.gather(positions(lay, self.scene.moved(first).y, first))
        kept = []
        for begin in range(0, int(ends[-1]), PART):
            n = min(PART, int(ends[-1]) - begin)
            t = (begin + np.arange(parts * n + 1) / parts) * SCHEME_STEP
            V = platform_screws(lay, self.scene.moved(t))[0]
            theta = march(side, theta[-1], V, SCHEME_STEP, method)
            kept.append(theta[ends[(ends > begin) & (ends <= begin + n)] - begin])
        q = side.scatter(np.concatenate(kept), len(mechanism.coordinates))
        values = {"joint_position": Values(mechanism.coordinates, mechanism.units, q)}
        return Solution(self.engine, "", values, empty(len(q)), cost=clock.cost())
