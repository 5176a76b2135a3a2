"""The diagnosis of two model files, from pairs of bodies to patches."""

from __future__ import annotations

from screwgauge.diagnosis.compare import STATES
from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.diagnose import summary
from screwgauge.diagnosis.differences.difference import ALL, digits_of, marked
from screwgauge.diagnosis.differences.static import differences
from screwgauge.diagnosis.library_dynamics import answers, pairs
from screwgauge.diagnosis.model import Model, in_process
from screwgauge.diagnosis.properties import Change, applied
from screwgauge.diagnosis.transformations import without

_MATTER = '<inertial pos="0.1 0 0.02" mass="{}" diaginertia="0.01 0.02 0.02"/>'
_LINKAGE = (
    f'<mujoco><worldbody><body name="crank"><joint name="a" axis="0 1 0"/>{_MATTER}'
    f'<body name="rod" pos="0 0 0.2"><joint name="b" axis="0 1 0"/>{_MATTER}</body></body>'
    f'<body name="rocker" pos="0.3 0 0"><joint name="c" axis="0 1 0"/>{_MATTER}'
    f'<body name="tip" pos="0 0 0.1"><joint name="d" axis="0 1 0"/>{_MATTER}</body></body></worldbody>'
    '<equality><connect name="loop" body1="rod" body2="rocker" anchor="0.3 0 0"{}/>'
    '<joint name="gear" joint1="d" joint2="a" polycoef="0 1 0 0 0"{}/></equality>{}</mujoco>'
)


def linkage(mass: float = 1, loop: str = "", gear: str = "", more: str = "") -> str:
    """MJCF of a four-bar whose rod ends in a point of the rocker, and of a tip that follows the crank.

    Args:
        mass: Of each body [kg].
        loop: Further attributes of its closure.
        gear: Further attributes of its coupling.
        more: Further elements.
    """
    return _LINKAGE.format(mass, mass, mass, mass, loop, gear, more)
