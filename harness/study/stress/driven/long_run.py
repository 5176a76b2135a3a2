"""A million samples at constant memory, and what an integrated scheme has drifted by then."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.study.stress.case import GOOD, Case, Finding, Rung

if TYPE_CHECKING:
    from screwgauge.scene.scene import Scene
    from screwgauge.solution import Values

STEP = 1e-3  # [s] between samples
SCHEME_STEP = 1e-2  # [s] of the paper's scheme
PART = 2048  # steps of the scheme at a time
CHECKED = 8  # samples at which the truth is asked, the last among them
QUANTITIES = ("joint_position", "generalized_force")
SCHEMES = {
    "paper Euler": ("euler", "steps of eq. (27): an error of first order that nothing corrects or estimates"),
    "paper RK4": ("rk4", "an error of fourth order that nothing corrects or estimates"),
}


def long_run() -> Case:
    """The default scene for a thousand seconds."""
    return Case(
        name="long-run",
        title="Long runs",
        axis="samples [1]",
        about=(
            "The default scene at 1 ms, streamed through `screw` part by part (`screwgauge.stream`): memory does not "
            "grow with the samples. Joint positions and generalised forces against the truth at up to eight samples, "
            "the last among them. Beside it the paper's own scheme, its twist set right, which integrates joint "
            "rates in steps of 10 ms: Euler's method drifts, Runge and Kutta's hardly does."
        ),
        drawn="joint_position",
        low=10.0,
        high=1e8,
        whole=True,
        full=(1e1, 1e2, 1e3, 1e4, 1e5, 1e6),
        quick=(1e1, 3e1, 1e2, 1e3, 3e3, 1e4),
        rung=lambda count, quick: Rung(count, lambda: climb(int(count))),
    )


def climb(count: int) -> Iterator[Finding]:
    """All engines over a number of samples."""
    from screwgauge.scene.read import load_scene
    from screwgauge.study.bench.reference import reference_values

    scene = load_scene("3ups-upu-s")
    at = _checked(count)
    right = reference_values(replace(scene, rule="min_norm"), at * STEP, QUANTITIES).values
    yield from _streamed(scene, count, at, right)
    for label, (method, cause) in SCHEMES.items():
        start = perf_counter()
        q = _drifted(scene, method, at)
        seconds = perf_counter() - start
        error = _error(scene, q, right["joint_position"])
        reason = cause if not error <= GOOD else ""
        yield Finding(label, "joint_position", error, time_s=seconds, reason=reason)


def _checked(count: int) -> Array:
    """Numbers of samples, from 1, that the scheme meets too; the last among them."""
    stride = round(SCHEME_STEP / STEP)
    return np.unique(np.geomspace(1, count // stride, CHECKED).round().astype(int)) * stride


def _streamed(scene: Scene, count: int, at: Array, right: Mapping[str, Values]) -> Iterator[Finding]:
    from screwgauge.study.stream import stream, times

    kept: dict[str, list[Array]] = {name: [] for name in QUANTITIES}
    condition, done, start = 0.0, 0, perf_counter()
    for t, solution in stream(scene, times(count, STEP, first=STEP), quantities=QUANTITIES):
        rows = at[(at > done) & (at <= done + len(t))] - done - 1
        for name in QUANTITIES:
            kept[name].append(solution.values[name].array[rows])
        condition, done = max(condition, float(solution.condition.max())), done + len(t)
    seconds = perf_counter() - start
    for name in QUANTITIES:
        error = _error(scene, np.concatenate(kept[name]), right[name])
        yield Finding("screw", name, error, condition=condition, time_s=seconds)


def _error(scene: Scene, found: Array, right: Values) -> float:
    """Scaled error at the samples checked."""
    from screwgauge.judging.compare import reference_scale
    from screwgauge.quantities import natural_scales

    natural = natural_scales(scene.mechanism)
    scale = np.array([reference_scale(right, unit, natural[unit]) for unit in right.units])
    return float((np.abs(found - right.array) / scale).max())


def _drifted(scene: Scene, method: str, at: Array) -> Array:
    """Joint positions of the paper's scheme at some samples. Shape (n, n_q)."""
    from screwgauge.reference.kinematics import positions
    from screwgauge.reference.paper.scheme import STEPPERS, chains
    from screwgauge.reference.paper.twist import platform_screws
    from screwgauge.reference.pose import layout

    lay = layout(scene.mechanism)
    side, parts = chains(lay), 1 if method == "euler" else 2
    ends = at // round(SCHEME_STEP / STEP)
    first = scene.drive(np.zeros(1))
    theta = side.gather(positions(lay, first.y, np.zeros(1)).q)
    found = []
    for begin in range(0, int(ends[-1]), PART):
        n = min(PART, int(ends[-1]) - begin)
        t = (begin + np.arange(parts * n + 1) / parts) * SCHEME_STEP
        V = platform_screws(lay, scene.drive(t), t)[0]
        theta = np.concatenate([theta[-1:], np.empty((n, *theta.shape[1:]))])
        STEPPERS[method](side, theta, V[:, None], SCHEME_STEP)
        met = ends[(ends > begin) & (ends <= begin + n)] - begin
        found.append(theta[met])
    return side.scatter(np.concatenate(found), len(lay.mechanism.coordinates))
