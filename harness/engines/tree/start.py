"""What every integration in an engine's open tree begins with: loops file, closed start, a clock."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter, process_time

import numpy as np

from screwgauge.engines.tree.closed_tree import solve_tree
from screwgauge.engines.tree.protocol import Tree
from screwgauge.models.loops import LoopsFile, read_loops
from screwgauge.problem import ForwardProblem, Motion, OldProblem
from screwgauge.reference.errors import DescriptionError, ModelFileError, SingularPoseError
from screwgauge.reference.rotations import Array


class Stopwatch:
    """Wall and processor time, without what is done aside."""

    def __init__(self) -> None:
        self.wall, self.cpu = perf_counter(), process_time()

    @contextmanager
    def aside(self) -> Iterator[None]:
        """What is done inside does not count."""
        wall, cpu = perf_counter(), process_time()
        yield
        self.wall += perf_counter() - wall
        self.cpu += process_time() - cpu

    def read(self) -> tuple[float, float]:
        """Seconds since the start."""
        return perf_counter() - self.wall, process_time() - self.cpu


def loops_file(problem: ForwardProblem) -> LoopsFile:
    """Reads the loops file beside the model.

    Raises:
        ModelFileError: There is none, or it cannot be read.
    """
    if problem.loops is None:
        raise ModelFileError("has no loops file", str(problem.model), "put NAME.loops.toml beside it")
    return read_loops(problem.loops)


def start_state(problem: ForwardProblem, tree: Tree, file: LoopsFile) -> tuple[Array, Array]:
    """Closed pose and rates at the start, reached from home on the engine's own poses. Shape (n_v,) each.

    Raises:
        ScrewgaugeError: Wrong shapes, or the loops cannot close there.
    """
    for what, part in (("start", problem.start), ("rates", problem.rates)):
        if np.shape(part) != (len(file.independent),):
            raise DescriptionError(
                f"{what} of shape {np.shape(part)} for {len(file.independent)} independent coordinates",
                file.mechanism,
                f"give {len(file.independent)} numbers",
            )
    y, yd = problem.start[None].astype(float), problem.rates[None].astype(float)
    motion = Motion(problem.times[:1].astype(float), y, yd, np.zeros_like(y))
    quantities = frozenset(("joint_position", "joint_velocity"))
    found = solve_tree(
        OldProblem(problem.model, problem.loops, problem.gravity, (), "min_norm", motion, quantities),
        tree,
        file,
    )
    names = [name for joint in file.joints for name in joint.coordinates]
    order = [names.index(name) for name in tree.coordinates]
    q, v = (found.values[name].array[0, order] for name in ("joint_position", "joint_velocity"))
    if not (np.isfinite(q).all() and np.isfinite(v).all()):
        raise SingularPoseError(
            "the independent coordinates do not determine the motion there",
            f"{tree.engine}, start of {file.mechanism}",
            "start elsewhere or choose other coordinates",
        )
    return q.copy(), v.copy()
