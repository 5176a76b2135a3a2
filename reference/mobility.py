"""Mobility: counts of degrees of freedom and constraints (section 2.2), uniqueness of forces, near singularities."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.closed.loops import LoopEquations, loop_equations
from screwgauge.reference.couplings import component_name
from screwgauge.reference.equations.forward import force_matrix
from screwgauge.reference.equations.joint_types import reaction_names
from screwgauge.reference.equations.kinematics import length, pose
from screwgauge.reference.equations.screws import velocity_at
from screwgauge.reference.errors import DescriptionError, first_few
from screwgauge.reference.graph import Layout, output_body
from screwgauge.reference.rotations import Array

#: Fraction of the largest component of a null vector below which a message omits components.
SHARE = 0.05
_named = partial(first_few, most=4)


@dataclass(frozen=True, slots=True, eq=False)
class Mobility:
    """Degrees of freedom and constraints of a mechanism at a pose.

    Attributes:
        bodies: Number of moving bodies.
        joint_freedoms: Sum of the degrees of freedom of all joints.
        kutzbach: Mobility by the Kutzbach formula, ``6 bodies - constraints``.
        mobility: `joint_freedoms` minus the rank of the loops and couplings.
        constraints: Number of reaction components, including couplings.
        constraint_rank: Rank of the columns of the reaction components in the Newton-Euler system.
        overconstraints: Number of redundant constraints.
        actuation_redundancy: Number of actuators in excess of the mobility.
        names: Reaction components, followed by actuators.
        unique: True for components that the motion alone determines, whichever rule resolves the redundant actuation.
        determined: True for components that are determined once such a rule is chosen; redundant constraints leave
            some components undetermined.
    """

    bodies: int
    joint_freedoms: int
    kutzbach: int
    mobility: int
    constraints: int
    constraint_rank: int
    overconstraints: int
    actuation_redundancy: int
    names: tuple[str, ...]
    unique: tuple[bool, ...]
    determined: tuple[bool, ...]

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names of the components that are not unique even if a rule resolves the redundant actuation."""
        return tuple(name for name, fixed in zip(self.names, self.determined, strict=True) if not fixed)


def mobility(lay: Layout, q: Array) -> Mobility:
    """Count degrees of freedom and constraints at a closed pose with joint coordinates `q`, shape (1, n_q)."""
    mechanism, G = lay.mechanism, loop_equations(lay).constraints(q)[0]
    c, names = _forces(lay, q), reaction_names(mechanism.joints, mechanism.couplings)[0]
    constraints = len(names)
    hidden = linear.null_space(c)  # forces that balance each other
    internal = linear.null_space(c[:, :constraints])  # balanced forces without actuator forces
    rank = constraints - internal.shape[1]
    freedoms = G.shape[1] - linear.rank(G)
    return Mobility(
        bodies=len(mechanism.bodies),
        joint_freedoms=len(mechanism.moving),
        kutzbach=6 * len(mechanism.bodies) - constraints,
        mobility=freedoms,
        constraints=constraints,
        constraint_rank=rank,
        overconstraints=constraints - rank,
        actuation_redundancy=hidden.shape[1] - (constraints - rank),
        names=(*names, *mechanism.actuator_names),
        unique=_flag_untouched(hidden),
        determined=_flag_untouched(internal) + (True,) * len(mechanism.actuator_names),
    )


def _forces(lay: Layout, q: Array) -> Array:
    """Return the matrix c of eq. (57) at one pose, scaled so that ranks do not depend on the size of the mechanism."""
    mechanism, at, unit = lay.mechanism, pose(lay, q), length(lay)
    units = *reaction_names(mechanism.joints, mechanism.couplings)[1], *mechanism.actuator_units
    c = force_matrix(at, q, at.S)[0] * np.where(np.array(units) == "N m", unit, 1.0)
    return np.asarray(c / np.resize(np.repeat([1.0, unit], 3), len(c))[:, None])


def _flag_untouched(hidden: Array) -> tuple[bool, ...]:
    """Flag the components that are zero in all hidden forces. Shape (m, k) -> m flags."""
    return tuple(bool(flag) for flag in np.abs(hidden).max(axis=1, initial=0.0) < 1e-9)


def check_independent(lay: Layout, q: Array) -> None:
    """Reject independent coordinates that do not determine the motion at a closed pose.

    Args:
        q: Joint coordinates. Shape (1, n_q).

    Raises:
        DescriptionError: The number of coordinates is not the number of degrees of freedom, or the coordinates are
            dependent.
    """
    mechanism, A = lay.mechanism, loop_equations(lay).matrix(q)[0]
    k = len(mechanism.independent)
    freedoms = A.shape[1] - linear.rank(A[: len(A) - k])
    names = ", ".join(f"{label} = {name}" for label, name in mechanism.independent.items())
    where = f"{mechanism.where}, independent"
    if k != freedoms:
        what = f"{k} independent coordinates ({names}) for {freedoms} degrees of freedom"
        raise DescriptionError(what, where, f"choose {freedoms}")
    if linear.rank(A) < A.shape[1]:
        raise DescriptionError(f"the coordinates {names} are not independent at the home pose", where, "choose others")


def near_singularity(lay: Layout, q: Array) -> str:
    """Describe the singularity that is nearest to a pose with joint coordinates `q`, shape (1, n_q).

    The right singular vector of the smallest singular value is the motion that loops no longer prevent while the
    independent coordinates are at rest; the left singular vector gives the cut-joint wrenches that no longer prevent
    it.
    """
    system = loop_equations(lay)
    U, _, Vt = np.linalg.svd(system.matrix(q)[0], full_matrices=False)
    motion = np.zeros(q.shape[1])
    motion[system.unknown] = Vt[-1]
    coordinates = [lay.mechanism.coordinates[i] for i in _large(motion)]
    bodies = _moved_bodies(lay, system, q, motion * system.sizes)
    chosen = ", ".join(lay.mechanism.independent)
    names = [*system.row_names, *(component_name(coupling) for coupling in lay.mechanism.couplings)]
    lost = [names[i] for i in _large(U[: len(names), -1], 0.3)]
    joints = list(dict.fromkeys(name.rsplit(".", 1)[0] for name in lost))
    constraint = f"; the constraint of {_named(joints)} is lost" if lost else ""
    freedom = f"a freedom that {chosen} do not determine ({_named(coordinates)} move){constraint}"
    if output_body(lay.mechanism) in bodies:
        return f"{output_body(lay.mechanism)} gains {freedom}"
    joint = next((j for j in lay.mechanism.joints if set(j.coordinates) >= set(coordinates)), None)
    if joint is not None and len(joint.coordinates) > 1:
        return f"{joint.name} locks: {_named(bodies)} turn idly ({_named(coordinates)} moves nothing else)"
    return f"{_named(bodies)} gain {freedom}"


def gimbal_lock(lay: Layout, cut: int) -> str:
    """Describe gimbal lock of cut joint number `cut`."""
    joint = lay.cuts[cut]
    first, last = joint.coordinates[0], joint.coordinates[-1]
    return f"{joint.name} is in gimbal lock ({first} and {last} turn about one line)"


def _large(values: Array, share: float = SHARE) -> list[int]:
    """Return the indices of values above a fraction of the largest value, in descending order of magnitude."""
    size = np.abs(values)
    order = np.argsort(-size, kind="stable")
    return [int(i) for i in order if size[i] > share * size.max(initial=0.0)]


def _moved_bodies(lay: Layout, system: LoopEquations, q: Array, motion: Array) -> list[str]:
    """Return the names of the bodies that a motion of the tree moves."""
    at = pose(lay, q)
    V = np.einsum("bi,i,ix->bx", lay.path, motion, at.S[0])[1:]
    v = velocity_at(V, at.com[0]) / system.length
    speed = np.abs(np.concatenate([V[:, :3], v], axis=1)).max(axis=1)
    return [lay.mechanism.bodies[i].name for i in sorted(_large(speed))]
