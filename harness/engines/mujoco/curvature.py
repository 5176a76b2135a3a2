"""What MuJoCo's joint equalities leave out: of the second derivative of ``q_i - p(q_j)`` the term ``-p'' v_j^2``.

MuJoCo has the like of it for connects and welds (from 3.7 on), but in 4.0.0 joint equalities count as straight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from screwgauge.problem import InitialValue, Problem, States
from screwgauge.reference.couplings import Coupling, CouplingRows, bind

_EQUALITY = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)


def curved(couplings: Sequence[Coupling]) -> list[Coupling]:
    """Those for which it is not zero."""
    return [one for one in couplings if one.polynomial[2:].any()]


@dataclass(frozen=True, slots=True, eq=False)
class Curvature:
    """Couplings that are no straight lines.

    Attributes:
        rows: These couplings, in MuJoCo's coordinates.
        ids: Number of the equality of each.
    """

    rows: CouplingRows
    ids: tuple[int, ...]

    def complete(self, data: mujoco.MjData) -> None:
        """Adds the term to the reference accelerations, after MuJoCo's velocity stage has made them."""
        if not self.ids:
            return
        for number, own in zip(self.ids, self.rows.bias(data.qpos[None], data.qvel[None])[0], strict=True):
            data.efc_aref[np.flatnonzero((data.efc_type == _EQUALITY) & (data.efc_id == number))] -= own


def curvature(model: mujoco.MjModel, couplings: Sequence[Coupling]) -> Curvature:
    """Binds the couplings that are `curved` to a model."""
    some = curved(couplings)
    rows = bind(some, [model.joint(j).name for j in range(model.njnt)])
    return Curvature(rows, tuple(model.equality(one.name).id for one in some))


def said(couplings: Sequence[Coupling], problem: Problem, *, own_steps: bool) -> tuple[str, ...]:
    """A sentence on couplings that MuJoCo takes for straight, where an answer rests on that.

    Args:
        own_steps: Simulations are MuJoCo's own, of which nothing is made better.
    """
    names, task = ", ".join(one.name for one in curved(couplings)), problem.task
    raw = isinstance(task, States) and task.tau is not None
    if not names or not (raw or isinstance(task, InitialValue) or "tree_force_soft" in problem.wanted):
        return ()
    fate = "missing from" if raw or (own_steps and isinstance(task, InitialValue)) else "added to"
    return (f"MuJoCo takes joint equalities for straight lines; their curvature is {fate} what it says: {names}",)
