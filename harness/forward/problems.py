"""The established problems A01 to A05: mechanism, forces, start, duration and observable of each."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from screwgauge.forward.integrate import NEAR, Trajectory, integrate
from screwgauge.models.catalog import load_mechanism
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.forward import Forces
from screwgauge.reference.pose import Layout, layout
from screwgauge.reference.rotations import Array
from screwgauge.reference.springs import PointSpring, Spring


@dataclass(frozen=True, slots=True)
class Problem:
    """One established problem.

    Attributes:
        mechanism: Built-in name.
        duration: Published end of the motion [s].
        observable: Coordinates of points, (body, point in its frame, world axis 0 to 2), or joint coordinates.
        names: Their names.
        gravity: [m/s^2].
        start, yd: Independent coordinates and rates at the start; home and rest where empty.
        motor: Joint coordinate and constant force [N m], if there is one.
        springs: Springs and dampers.
        method, rtol, atol, near: What suits it, see `screwgauge.forward.integrate.integrate`.
    """

    mechanism: str
    duration: float
    observable: tuple[tuple[str, tuple[float, float, float], int] | str, ...]
    names: tuple[str, ...]
    gravity: tuple[float, float, float] = (0.0, -9.81, 0.0)
    start: tuple[float, ...] = ()
    yd: tuple[float, ...] = ()
    motor: tuple[str, float] | None = None
    springs: tuple[Spring, ...] = field(default=())
    method: str = "DOP853"
    rtol: float = 1e-12
    atol: float = 1e-12
    near: float = NEAR


def _andrews(duration: float, start: tuple[float, ...] = ()) -> Problem:
    end = (0.007, 0.0, 0.0)
    spring = PointSpring(
        "ground",
        np.array([0.014, 0.072, 0.0]),
        "K3",
        np.array([0.02, -0.018, 0.0]),
        stiffness=4530.0,
        rest=0.07785,
    )
    return Problem(
        "a03-andrews",
        duration,
        (("K1", end, 0), ("K1", end, 1), "beta"),
        ("F.x", "F.y", "beta"),
        gravity=(0.0, 0.0, 0.0),
        start=start,
        motor=("beta", 0.033),
        springs=(spring,),
    )


def _four_bars(n: int) -> Problem:
    b0 = (0.0, 1.0, 0.0)
    return Problem(
        f"a02-fourbar-{n}",
        10.0,
        (("upright0", b0, 0), ("upright0", b0, 1)),
        ("B0.x", "B0.y"),
        yd=(-1.0,),
        rtol=1e-10 if n < 10 else 1e-7,
        atol=1e-10 if n < 10 else 1e-7,
        # many links in a row have a large condition number everywhere: 6e4 for 40 at their best
        near=NEAR if n < 10 else 5e6,
    )


def _bricard(kind: str) -> Problem:
    p3 = (0.0, -1.0, 0.0)
    return Problem(
        f"a04-bricard-{kind}",
        10.0,
        tuple(("rod2", p3, axis) for axis in range(3)),
        ("P3.x", "P3.y", "P3.z"),
    )


def _governor() -> Problem:
    springs = tuple(
        PointSpring(
            "slider",
            np.array([0.05 * side, 0.0, 0.0]),
            rod,
            np.array([0.5 * side, 0.0, 0.0]),
            stiffness=8e5,
            rest=0.5,
            damping=4e4,
        )
        for rod, side in (("right", 1.0), ("left", -1.0))
    )
    return Problem(
        "a05-governor",
        10.0,
        ("slide",),
        ("s",),
        gravity=(0.0, 0.0, -9.81),
        yd=(2.0 * np.pi, 0.0, 0.0, 0.0),
        springs=springs,
        method="Radau",
        rtol=1e-7,
        atol=1e-7,
    )


_BOB = (0.0, -1.0, 0.0)
PROBLEMS = {
    "a01-pendulum": Problem("a01-pendulum", 10.0, (("bob", _BOB, 0), ("bob", _BOB, 1)), ("x", "y")),
    "a02-fourbar-2": _four_bars(2),
    "a02-fourbar-40": _four_bars(40),
    "a03-andrews-ivp": _andrews(0.03),
    "a03-andrews-iftomm": _andrews(0.05, (-0.062,)),
    "a04-bricard-thin": _bricard("thin"),
    "a04-bricard-box": _bricard("box"),
    "a05-governor": _governor(),
}


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """What the solver says to a problem.

    Attributes:
        lay: The mechanism.
        forces: What acts on it.
        trajectory: Its motion.
        observable: What the problem asks for [m or rad]. Shape (n, n_component).
    """

    lay: Layout
    forces: Forces
    trajectory: Trajectory
    observable: Array


def problem_forces(problem: Problem, lay: Layout) -> Forces:
    """Gravity, motor and springs of a problem."""
    joints = np.zeros(len(lay.mechanism.coordinates))
    if problem.motor is not None:
        coordinate, amount = problem.motor
        joints[lay.mechanism.coordinates.index(coordinate)] = amount
    return Forces(joints=joints, gravity=np.array(problem.gravity), springs=problem.springs)


def solve_problem(
    name: str, times: Array | None = None, *, rtol: float | None = None, atol: float | None = None
) -> Answer:
    """Integrates an established problem.

    Args:
        name: One of `PROBLEMS`.
        times: Where the motion is wanted, the first being the start [s]; start and end by default. Shape (n,).
        rtol, atol: Tolerances in place of the problem's own.

    Raises:
        UnknownNameError: There is no such problem.
    """
    if name not in PROBLEMS:
        raise UnknownNameError("problem", name, PROBLEMS)
    problem = PROBLEMS[name]
    lay = layout(load_mechanism(problem.mechanism))
    forces = problem_forces(problem, lay)
    found = integrate(
        lay,
        forces,
        np.array([0.0, problem.duration]) if times is None else times,
        start=np.array(problem.start) if problem.start else None,
        yd=np.array(problem.yd) if problem.yd else None,
        method=problem.method,
        rtol=problem.rtol if rtol is None else rtol,
        atol=problem.atol if atol is None else atol,
        near=problem.near,
    )
    return Answer(lay, forces, found, _observable(problem, lay, found))


def _observable(problem: Problem, lay: Layout, found: Trajectory) -> Array:
    at, columns = found.rates.pose, []
    for item in problem.observable:
        if isinstance(item, str):
            columns.append(at.q[:, lay.mechanism.coordinates.index(item)])
        else:
            body, point, axis = item
            i = lay.mechanism.body_index[body]
            columns.append(at.p[:, i, axis] + at.R[:, i, axis] @ np.array(point))
    return np.stack(columns, axis=1)
