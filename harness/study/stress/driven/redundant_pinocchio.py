"""Pinocchio's accelerations on loops with redundant constraints, closed by points and by whole frames."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np
import pinocchio as pin

from screwgauge.engines.pinocchio.tree import PinocchioTree
from screwgauge.reference import linear
from screwgauge.reference.rotations import Array
from screwgauge.study.bench.case import Case
from screwgauge.study.bench.contestants_pinocchio import contacts, load, place
from screwgauge.study.bench.projection import Given, given
from screwgauge.study.stress.case import Finding
from screwgauge.study.stress.driven.loaded import finding
from screwgauge.study.stress.driven.redundant import locked

#: Regular whatever the rank; two iterations leave about 1e-15, see the case `proximal`.
MU, ITERATIONS = 1e-10, 5


def points(case: Case) -> Finding:
    """Every cut hinge held by two points on its axis."""
    start = given(case, *load(case))
    return _measure(case, "pinocchio 3D", start, contacts(start))


def frames(case: Case) -> Finding:
    """Every cut hinge held by its two frames, as a weld would."""
    start = given(case, *load(case))
    tree = start.tree
    assert isinstance(tree, PinocchioTree)
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for closure in tree.closures:
        sides = (
            *place(tree, closure.parent, closure.parent_frame.p),
            *place(tree, closure.child, closure.child_frame.p),
        )
        models.append(
            pin.RigidConstraintModel(pin.ContactType.CONTACT_6D, tree.model, *sides, pin.ReferenceFrame.LOCAL)
        )
    for model in models:
        datas.append(model.createData())
    data = tree.model.createData()
    pin.initConstraintDynamics(tree.model, data, models, datas)
    return _measure(case, "pinocchio 6D", start, (tree.model, data, models, datas))


def _measure(case: Case, label: str, start: Given, parts: tuple[Any, Any, Any, Any]) -> Finding:
    model, data, models, datas = parts
    settings = pin.ProximalSettings(0.0, 0.0, MU, ITERATIONS)
    tau, found = start.applied(), np.empty_like(start.q)
    clock = perf_counter()
    for i in range(len(found)):
        found[i] = pin.constraintDynamics(model, data, start.q[i], start.v[i], tau[i], models, datas, settings)
    seconds = perf_counter() - clock
    D, J = _delassus(start, parts)
    return finding(
        case,
        label,
        start.tree.coordinates,
        found,
        seconds=seconds,
        condition=float(linear.condition(D + MU * np.eye(len(D)))),
        cause=locked(J),
    )


def _delassus(start: Given, parts: tuple[Any, Any, Any, Any]) -> tuple[Array, Array]:
    """``J M^-1 J^T`` and J at the last sample."""
    model, data, models, datas = parts
    pin.computeJointJacobians(model, data, start.q[-1])
    upper = np.triu(pin.crba(model, data, start.q[-1]))
    J = np.asarray(pin.getConstraintsJacobian(model, data, models, datas))
    return J @ np.linalg.solve(upper + np.triu(upper, 1).T, J.T), J
