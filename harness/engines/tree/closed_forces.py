"""Forces of the closed mechanism by projection of an engine's tree forces, multipliers from what is left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.engines.tree.closure import Loops
from screwgauge.engines.tree.protocol import BodyPoses, Tree
from screwgauge.engines.tree.rules import axial_forces
from screwgauge.engines.tree.sizes import Sizes
from screwgauge.engines.tree.transmission import joint_reactions, joint_sides
from screwgauge.models.loops import LoopsFile
from screwgauge.problem import OldProblem
from screwgauge.reference import linear
from screwgauge.reference.dynamics import min_norm
from screwgauge.reference.rotations import Array
from screwgauge.reference.wrenches import State, applied_wrenches


@dataclass(frozen=True, slots=True, eq=False)
class SetOut:
    """What stays the same over a trajectory."""

    problem: OldProblem
    tree: Tree
    file: LoopsFile
    loops: Loops
    sizes: Sizes

    @property
    def driven(self) -> list[int]:
        """Columns of the actuated coordinates."""
        return [self.tree.coordinates.index(j.coordinates[0]) for j in self.file.joints if j.actuated]


@dataclass(frozen=True, slots=True, eq=False)
class ClosedForces:
    """Forces of some samples.

    Attributes:
        values: Quantity -> shape (n, m).
        conditions: Quantity -> condition number of its equations, if it has some of its own. Shape (n,).
        largest: Largest force that the tree needs, moments over the mechanism's length [N]. Shape (n,).
        reactions: Names and units of the reaction components, if these are wanted.
    """

    values: dict[str, Array]
    conditions: dict[str, Array]
    largest: Array
    reactions: tuple[tuple[str, ...], tuple[str, ...]] | None = None


def closed_forces(
    out: SetOut, at: BodyPoses, A: Array, K: Array, motion: tuple[Array, Array, Array, Array], state: State
) -> ClosedForces:
    """Generalised and actuator forces by projection, reactions from the multipliers of the closing rows.

    Args:
        A: Closing system without dimension. Shape (n, m + k, n_v).
        K: Rates of the tree per rate of y. Shape (n, n_v, k).
        motion: Coordinates, rates, accelerations and forces of the open tree. Shape (n, n_v) each.
        state: The same motion as springs and motors see it.
    """
    tau, wanted = motion[3], out.problem.quantities
    load = _loads(out, at, state)
    need = tau - np.einsum("nbxi,nbx->ni", at.J, np.concatenate([load[..., 3:], load[..., :3]], axis=2))
    Q = (K.swapaxes(1, 2) @ need[..., None])[..., 0]
    largest = np.abs(need * out.sizes.q).max(axis=1) / out.sizes.length
    values = {"generalized_force": Q}
    if not wanted & {"actuator_force", "reaction"}:
        return ClosedForces(values, {}, largest)
    driven = out.driven
    f, condition = min_norm(K[:, driven], Q), linear.condition(K[:, driven])
    conditions = {"actuator_force": condition}
    if out.problem.rule == "spherical_axial":
        G = out.loops.jacobian(at)
        f, condition = axial_forces(out.file, out.loops, at, G, need, driven)
        conditions = dict.fromkeys(("actuator_force", "reaction"), condition)
    values["actuator_force"] = f
    if "reaction" not in wanted:
        return ClosedForces(values, conditions, largest)
    rest = need.copy()
    rest[:, driven] -= f
    multipliers = _multipliers(out, A[:, : A.shape[1] - K.shape[2]], rest)
    found = out.tree.transmitted(*motion[:3], load + out.loops.wrenches(at, multipliers))
    reactions, values["reaction"] = joint_reactions(out.file, out.tree, out.loops, at, found, multipliers)
    return ClosedForces(values, conditions, largest, (reactions.names, reactions.units))


def _multipliers(out: SetOut, G: Array, rest: Array) -> Array:
    """Forces of the closing rows that deliver what the actuators leave. Shape (n, m)."""
    scaled = linear.solve(G.swapaxes(1, 2), (rest * out.sizes.q)[..., None])
    return np.asarray(scaled[..., 0] / out.sizes.rows[: G.shape[1]])


def _loads(out: SetOut, at: BodyPoses, state: State) -> Array:
    """Loads, springs and motors: force and moment about the origin of each body. Shape (n, n_body + 1, 6)."""
    found, problem, loops = np.zeros((*at.p.shape[:2], 6)), out.problem, out.loops
    if problem.springs or problem.motors:
        found += applied_wrenches(
            out.file.joints,
            problem.springs,
            problem.motors,
            state,
            loops.index,
            lambda joint: joint_sides(joint, loops),
        )
    for load in problem.loads:
        i = loops.index[load.body]
        arm = at.R[:, i] @ (out.tree.com[i - 1] if load.point is None else load.point)
        found[:, i, :3] += load.force
        found[:, i, 3:] += load.torque + np.cross(arm, load.force)
    return found
