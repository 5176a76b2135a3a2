"""The engine `screw` driven forward: `screwgauge.engines.screw.inverse.integrate` on the description."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter, process_time

import numpy as np

import screwgauge
from screwgauge.engines.screw.integrate import Trajectory
from screwgauge.engines.screw.integrate import integrate as integrate_layout
from screwgauge.models.catalog import load_mechanism
from screwgauge.problem import ForwardProblem
from screwgauge.reference import linear
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.forward import Forces, forward
from screwgauge.reference.kinematics import Rates, accelerations
from screwgauge.reference.pose import Layout, Pose, layout
from screwgauge.reference.rotations import Array
from screwgauge.solution import ForwardSolution


def integrate(problem: ForwardProblem) -> ForwardSolution:
    """Integrates a mechanism described by TOML.

    Raises:
        ScrewgaugeError: The description is not that of the problem, or the start cannot be.
    """
    lay, method = layout(load_mechanism(problem.model)), problem.method
    _check(problem, lay)
    forces = forces_over_time(problem, lay)
    cpu, start = process_time(), perf_counter()
    found = integrate_layout(
        lay,
        forces,
        problem.times,
        start=problem.start,
        yd=problem.rates,
        method=method.name,
        rtol=method.rtol,
        atol=method.atol,
        near=method.near,
        progress=problem.progress,
    )
    seconds, cpu = perf_counter() - start, process_time() - cpu
    a, condition = joint_accelerations(lay, found, forces)
    over = f", {found.stepped_over} steps resized near singular poses" if found.stepped_over else ""
    return ForwardSolution(
        engine="screw",
        version=screwgauge.__version__,
        setting=f"{method.name}, rtol {method.rtol:g}, atol {method.atol:g}",
        q=found.rates.pose.q,
        v=found.rates.w,
        a=a,
        work=found.work,
        condition=condition,
        steps=found.steps,
        evaluations=found.evaluations,
        seconds=seconds,
        cpu=cpu,
        stopped=found.stopped,
        notes=(f"independent coordinates integrated, poses followed on one branch{over}",),
    )


def _check(problem: ForwardProblem, lay: Layout) -> None:
    k = len(lay.mechanism.independent)
    if len(problem.start) != k:
        raise ModelFileError(
            f"has {k} independent coordinates, the start {len(problem.start)}",
            str(problem.model),
            "name a description of the same mechanism",
        )


def forces_over_time(problem: ForwardProblem, lay: Layout) -> Callable[[float], Forces]:
    """All that acts, as a function of time [s]."""
    columns = [lay.mechanism.coordinates.index(motor.coordinate) for motor in problem.motors]
    loads = [(load.body, load.point, load.force, load.torque) for load in problem.loads]

    def at(t: float) -> Forces:
        joints = np.zeros(len(lay.mechanism.coordinates))
        for column, motor in zip(columns, problem.motors, strict=True):
            joints[column] += motor.force(t)
        return Forces(joints=joints, gravity=problem.gravity, loads=loads, springs=problem.springs)

    return at


def joint_accelerations(lay: Layout, found: Trajectory, forces: Callable[[float], Forces]) -> tuple[Array, Array]:
    """Accelerations of all joint coordinates, shape (n, n_q), and the condition of the closed loops, shape (n,)."""
    rate = found.rates
    condition = linear.condition(rate.A)
    ydd = np.full((len(found.t), rate.K.shape[2]), np.nan)
    for i in np.flatnonzero(condition < linear.SINGULAR):
        ydd[i] = forward(lay, _part(rate, int(i)), forces(float(found.t[i]))).ydd[0]
    return accelerations(lay, rate, ydd)[0], condition


def _part(rate: Rates, i: int) -> Rates:
    """One sample."""
    here, at = slice(i, i + 1), rate.pose
    pose = Pose(at.q[here], at.R[here], at.p[here], at.S[here], at.gap[here])
    return replace(
        rate,
        pose=pose,
        K=rate.K[here],
        A=rate.A[here],
        w=rate.w[here],
        V=rate.V[here],
        charts=rate.charts[here],
    )
