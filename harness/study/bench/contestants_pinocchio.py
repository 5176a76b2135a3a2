"""Pinocchio: from RNEA to actuator forces, and `constraintDynamics` over its proximal settings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from screwgauge.engines.pinocchio.tree import PinocchioTree
from screwgauge.models.loops import LoopsFile, read_loops
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array
from screwgauge.study.bench.case import Case
from screwgauge.study.bench.contestant import Contestant, Outcome, Task, count
from screwgauge.study.bench.contestants_tree import engine_paths, inverse_projected
from screwgauge.study.bench.projection import Given, given

MU = (*(10.0**-k for k in range(2, 15)), 0.0)
ITERATIONS = (1, 2, 5, 20)
#: What diagrams name: iterations -> mu.
_NAMED = {1: (MU[0], MU[4], MU[8], MU[12]), 2: (MU[2], MU[4], MU[6]), 5: MU[:2], 20: MU[:1]}
_NAME = "joint_acceleration"


def load(case: Case) -> tuple[PinocchioTree, LoopsFile]:
    """The URDF of the minimal cut, loaded."""
    problem = case.problem("pinocchio", (_NAME,))
    assert problem.loops is not None
    file = read_loops(problem.loops)
    return PinocchioTree(problem.model, file, problem.gravity), file


def path(quick: bool) -> list[Contestant]:
    """The engine as `screwgauge run` drives it."""
    return engine_paths("pinocchio", load, "Newton on its own poses, rates, Jdot v, RNEA, projection")


def rnea(quick: bool) -> list[Contestant]:
    """RNEA on the true joint motion, then projection on the actuators."""
    return [inverse_projected(load, "RNEA, then projection", "pin.rnea", "RNEA + projection")]


def ladder(quick: bool) -> list[Contestant]:
    """`constraintDynamics` for the true actuator forces over mu and the number of iterations."""
    return [_forward(mu, iterations) for iterations in ITERATIONS for mu in MU]


def default(quick: bool) -> list[Contestant]:
    """With the settings that `pin.ProximalSettings()` has."""
    settings = pin.ProximalSettings()
    setting = f"ProximalSettings(): mu = {settings.mu:g}, {count(settings.max_iter, 'iteration')}"
    return [_contestant(setting, pin.ProximalSettings, label="default", series="default")]


def _forward(mu: float, iterations: int) -> Contestant:
    times = count(iterations, "iteration")
    named = mu in _NAMED.get(iterations, ())
    return _contestant(
        f"mu = {mu:g}, {times}",
        lambda: pin.ProximalSettings(0.0, 0.0, mu, iterations),  # accuracy 0: all iterations are made
        series=times,
        parameter=("mu", mu) if mu else None,
        label=f"mu {mu:g}" if named else "",
    )


def _contestant(setting: str, settings: Callable[[], Any], **more: Any) -> Contestant:
    def prepare(case: Case) -> Task:
        start: Given = case.share("pinocchio forward", lambda: given(case, *load(case)))
        model = case.share("pinocchio contacts", lambda: contacts(start))
        call = forward(start, *model, settings())
        hint = "mu = 0 needs closure rows of full rank" if "mu = 0" in setting else ""

        def read(array: Array) -> dict[str, Outcome]:
            return {_NAME: case.outcome(_NAME, array, start.tree.coordinates)}

        return Task(call, read, len(start.q), hint)

    covers = "from given q, v and true forces: pin.constraintDynamics sample by sample; tree accelerations only"
    return Contestant(setting, (_NAME,), covers, prepare, given=True, **more)


def forward(start: Given, model: Any, data: Any, models: Any, datas: Any, settings: Any) -> Callable[[], Array]:
    """A call that finds all accelerations. Returns shape (n, n_v)."""
    q, v, tau = start.q, start.v, start.applied()
    out = np.empty_like(q)

    def call() -> Array:
        for i in range(len(q)):
            out[i] = pin.constraintDynamics(model, data, q[i], v[i], tau[i], models, datas, settings)
        return out.copy()

    return call


def contacts(start: Given) -> tuple[Any, Any, Any, Any]:
    """Model, data, constraint models and their data: one 3D contact for each pair of points that closes a loop."""
    tree = start.tree
    assert isinstance(tree, PinocchioTree)
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for closure in tree.closures:
        for here, there in zip(closure.parent_points, closure.child_points, strict=True):
            sides = (*place(tree, closure.parent, here), *place(tree, closure.child, there))
            models.append(
                pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, tree.model, *sides, pin.ReferenceFrame.LOCAL)
            )
    for model in models:
        datas.append(model.createData())
    data = tree.model.createData()
    pin.initConstraintDynamics(tree.model, data, models, datas)
    return tree.model, data, models, datas


def place(tree: PinocchioTree, body: str, point: Array) -> tuple[int, Any]:
    """Joint that carries a body, and a point of the body in that joint's frame."""
    at = pin.SE3(np.eye(3), point)
    if body == GROUND:
        return 0, at
    frame = tree.model.frames[tree.frames[tree.bodies.index(body)]]
    return frame.parentJoint, frame.placement * at
