"""What is checked of a forward scene before any engine runs: home, start, stiffness."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from screwgauge.engines.screw.forward import forces_over_time
from screwgauge.problem import ForwardProblem, Progress
from screwgauge.reference.errors import DescriptionError, JointLimitError
from screwgauge.reference.forward import forward
from screwgauge.reference.kinematics import positions, rates
from screwgauge.reference.pose import Layout
from screwgauge.scene.preflight import FARTHEST, check_home, check_regular
from screwgauge.scene.scene import Scene
from screwgauge.scene.setting import Forward
from screwgauge.scene.stiffness import stiff_warning, stiffness


def make_problem(
    scene: Scene, start: Forward, model: Path, loops: Path | None, progress: Progress = lambda share: None
) -> ForwardProblem:
    """What an engine is given; its times begin with that of the start."""
    t = scene.motion.t
    return ForwardProblem(
        model=model,
        loops=loops,
        gravity=scene.gravity,
        loads=scene.loads,
        springs=scene.springs,
        motors=scene.motors,
        start=start.start,
        rates=start.rates,
        times=t if t[0] == start.since and len(t) > 1 else np.union1d([start.since], t),
        method=start.method,
        progress=progress,
    )


def check_start(scene: Scene, start: Forward) -> tuple[Layout, tuple[str, ...]]:
    """Refuses a start that cannot be, and warns of a stiff scene.

    Returns:
        The mechanism laid out, and sentences to be shown.

    Raises:
        ScrewgaugeError: Home or start do not close, or lie beyond a limit, or no force can move a coordinate.
    """
    lay = check_home(scene.mechanism)
    problem = make_problem(scene, start, scene.mechanism_file, None)
    _check_ends(scene, start, problem)
    at = positions(lay, start.start[None], np.array([start.since]))
    check_regular(lay, at, np.array([start.since]), start.start[None], None)
    low, high = scene.mechanism.limits.T
    beyond = np.flatnonzero((at.q[0] < low) | (at.q[0] > high))
    if beyond.size:
        i = beyond[0]
        raise JointLimitError(
            f"joint coordinate '{scene.mechanism.coordinates[i]}' = {at.q[0, i]:.6g} "
            f"is beyond its limits [{low[i]:g}, {high[i]:g}]",
            "start of the scene",
            "start elsewhere or widen the limits",
        )
    forces = forces_over_time(problem, lay)
    forward(lay, rates(lay, at, start.rates[None]), forces(start.since))
    warning = stiff_warning(stiffness(lay, forces, start), start, float(scene.motion.t[-1]))
    return lay, (warning,) if warning else ()


def _check_ends(scene: Scene, start: Forward, problem: ForwardProblem) -> None:
    if len(problem.times) < 2:
        raise DescriptionError(
            f"the only time, {start.since:g} s, is that of the start", "times", "give later times, too"
        )
    away = np.abs(start.start - scene.mechanism.home[scene.mechanism.independent_columns])
    if not away.max(initial=0.0) <= FARTHEST:
        raise DescriptionError(
            f"the start is {away.max():.3g} rad or m away from the home pose",
            scene.name,
            f"start within {FARTHEST:g}; check its units",
        )
