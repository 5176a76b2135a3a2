"""Small models as text, of which the right numbers are known in closed form, and what a discrepancy on one measures."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True)
class Evidence:
    """A number, obtained in three ways.

    Attributes:
        symptom: As users get it; NaN where there is none.
        expected: As it should be, from a formula, from equations solved here, or from the other engine.
        mended: As users get it after the remedy.
        unit: Of all three; empty of a plain number.
        said: The engine's message where it refuses or warns.
    """

    symptom: float
    expected: float
    mended: float
    unit: str
    said: str = ""


G = 9.81  #: [m/s^2]
#: The bar: [kg], [m] from the hinge along x, [kg m^2] about its centre of mass.
MASS, ARM, MOMENT = 2.0, 0.3, 0.05
INERTIAL = f'<inertial pos="{ARM} 0 0" mass="{MASS}" diaginertia="{MOMENT} {MOMENT} {MOMENT}"/>'
#: Forces at the hinge of a level bar along y, gravity down: of its weight, and of an acceleration of 1 rad/s^2.
WEIGHT, INERTIA = -MASS * G * ARM, MOMENT + MASS * ARM**2


def numbers(values: Iterable[float]) -> str:
    """Numbers for an attribute, unrounded."""
    return " ".join(repr(float(value)) for value in values)


def mjcf(worldbody: str, *, before: str = "", after: str = "") -> str:
    return f'<mujoco><compiler angle="radian"/>{before}<worldbody>{worldbody}</worldbody>{after}</mujoco>'


def body(name: str, inside: str = "", *, joint: str = "", at: str = "0 0 0", attributes: str = "") -> str:
    """A level bar on a hinge about y as a body of an MJCF.

    Args:
        inside: Of its body, after the bar's own.
        joint: Further attributes of its joint, which is named after it.
        at: Its place on its parent [m].
        attributes: Further ones of the body.
    """
    hinge = f'<joint name="{name}" axis="0 1 0" {joint}/>'
    return f'<body name="{name}" pos="{at}" {attributes}>{hinge}{INERTIAL}{inside}</body>'


def robot(*parts: str) -> str:
    """A URDF on the link ``base``."""
    return f'<robot name="sample"><link name="base"/>{"".join(parts)}</robot>'


def link(
    name: str, *, mass: float = MASS, com: str = f"{ARM} 0 0", turned: str = "0 0 0", tensor: Sequence[float] = ()
) -> str:
    """A link of a URDF, the bar by default.

    Args:
        turned: Roll, pitch and yaw of its inertial frame [rad].
        tensor: xx, yy, zz, xy, xz, yz [kg m^2]; those left out are zero.
    """
    values = [*(tensor or (MOMENT,) * 3), 0.0, 0.0, 0.0][:6]
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    entries = " ".join(f'{key}="{value!r}"' for key, value in zip(names, values, strict=True))
    inertial = f'<origin xyz="{com}" rpy="{turned}"/><mass value="{mass!r}"/><inertia {entries}/>'
    return f'<link name="{name}"><inertial>{inertial}</inertial></link>'


def joint(
    child: str, parent: str = "base", *, kind: str = "revolute", axis: str = "0 1 0", origin: str = "", inside: str = ""
) -> str:
    """A joint of a URDF, named after its child.

    Args:
        origin: Attributes of its placement.
        inside: Further elements.
    """
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin {origin}/><axis xyz="{axis}"/>'
    limit = '<limit lower="-9" upper="9" effort="1" velocity="1"/>'
    return f'<joint name="{child}" type="{kind}">{ends}{limit}{inside}</joint>'


class FourBar:
    """A four-bar in the x-y plane with gravity along -y, in motion at home, where all coordinates are zero.

    The tree is cut where coupler and rocker meet: crank `a` on the ground, coupler `b` on the crank, rocker `d` on the
    ground. Angles, velocities and accelerations of its links are those of a chain of rods; the torque that the crank
    needs is that of virtual power.
    """

    base = np.array([0.5, 0.0])  #: Where the rocker stands [m].
    #: Lengths [m], masses [kg] and moments about their centres [kg m^2] of uniform crank, coupler and rocker.
    lengths, masses = np.array([0.3, 0.6, 0.4]), np.array([1.0, 2.0, 1.5])
    moments = masses * lengths**2 / 12.0
    gravity = np.array([0.0, -G])
    #: Rates of the tree's coordinates from those of the links.
    _tree = np.array([[1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])

    def __init__(self, speed: float = 10.0, crank: float = np.pi / 3) -> None:
        """Moves the crank.

        Args:
            speed: Of the crank, which does not accelerate [rad/s].
            crank: Its angle at home [rad].
        """
        self.speed = speed
        first, second, third = self.lengths
        elbow = first * np.array([np.cos(crank), np.sin(crank)])
        across = self.base - elbow
        reach = np.hypot(*across)
        inside = np.arccos((second**2 + reach**2 - third**2) / (2.0 * second * reach))
        coupler = np.arctan2(across[1], across[0]) + inside
        tip = elbow + second * np.array([np.cos(coupler), np.sin(coupler)])
        rocker = np.arctan2(*(tip - self.base)[::-1])
        self.elbow, self.tip = elbow, tip
        self.along = np.array([[np.cos(angle), np.sin(angle)] for angle in (crank, coupler, rocker)])
        self.across = self.along[:, ::-1] * [-1.0, 1.0]

    @cached_property
    def _rates(self) -> tuple[Array, Array]:
        lengths = self.lengths
        closing = np.column_stack([lengths[1] * self.across[1], -lengths[2] * self.across[2]])
        omega = np.array([self.speed, *np.linalg.solve(closing, -lengths[0] * self.across[0] * self.speed)])
        inwards = (lengths * omega**2 * [1.0, 1.0, -1.0]) @ self.along
        return omega, np.array([0.0, *np.linalg.solve(closing, inwards)])

    @property
    def v(self) -> Array:
        return self._tree @ self._rates[0]

    @property
    def a(self) -> Array:
        return self._tree @ self._rates[1]

    @cached_property
    def torque(self) -> float:
        """Torque of the motor at the crank [N m]: power of inertia and weight per speed of the crank."""
        omega, alpha = self._rates
        arms = np.array([[0.5, 0.0, 0.0], [1.0, 0.5, 0.0], [0.0, 0.0, 0.5]]) * self.lengths
        v = (arms * omega) @ self.across
        a = (arms * alpha) @ self.across - (arms * omega**2) @ self.along
        power = self.masses @ np.sum((a - self.gravity) * v, axis=1) + self.moments @ (alpha * omega)
        return float(power / self.speed)

    @property
    def ends(self) -> tuple[Array, Array]:
        return np.array([*(self.tip - self.elbow), 0.0]), np.array([*(self.tip - self.base), 0.0])

    def mjcf(self, closure: str = '<connect site1="coupler" site2="rocker"/>') -> str:
        coupler, rocker = (f'pos="{numbers(end)}"' for end in self.ends)
        second = self._body(1, "b", self.elbow, f'<site name="coupler" {coupler}/>')
        first = self._body(0, "a", np.zeros(2), second)
        third = self._body(2, "d", self.base, f'<site name="rocker" {rocker}/>')
        option = f'<option gravity="{numbers([*self.gravity, 0.0])}" tolerance="1e-15"/>'
        return mjcf(first + third, before=option, after=f"<equality>{closure}</equality>")

    def _body(self, k: int, name: str, at: Array, inside: str) -> str:
        com, moment = self.along[k] * self.lengths[k] / 2.0, self.moments[k]
        mass = f'mass="{self.masses[k]}" diaginertia="{numbers([moment] * 3)}"'
        inertial = f'<inertial pos="{numbers([*com, 0.0])}" {mass}/>'
        hinge = f'<joint name="{name}" axis="0 0 1"/>'
        return f'<body name="{name}" pos="{numbers([*at, 0.0])}">{hinge}{inertial}{inside}</body>'
