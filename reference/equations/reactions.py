"""Names of reaction components: of the joints, those of one role together, then of the couplings."""

from __future__ import annotations

from screwgauge.reference.couplings import component_name
from screwgauge.reference.equations.joint_types import components
from screwgauge.reference.mechanism import Joint, Mechanism


def by_role(mechanism: Mechanism) -> list[Joint]:
    """The joints, grouped by role in the order in which the roles first appear."""
    roles = list(dict.fromkeys(joint.role for joint in mechanism.joints))
    return sorted(mechanism.joints, key=lambda joint: roles.index(joint.role))


def reaction_names(mechanism: Mechanism) -> list[tuple[str, str]]:
    """Name and unit of every component: ``leg1.base.fx`` and N; of couplings, along their coordinates."""
    units = {name: "N m" if unit == "rad" else "N" for name, unit in _units(mechanism)}
    of_joints = [(f"{joint.name}.{label}", unit) for joint in by_role(mechanism) for label, unit in components(joint)]
    return of_joints + [(component_name(one), units[one.coordinate]) for one in mechanism.couplings]


def _units(mechanism: Mechanism) -> list[tuple[str, str]]:
    return [*zip(mechanism.coordinates, mechanism.units, strict=True)]
