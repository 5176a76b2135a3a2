"""What a difference to a black box looks like: how it grows with speed, and which change of the model would make it.

A black box is an engine whose own torques are not those of what it has read, or torques of a user.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from screwgauge.diagnosis.causes.attribution import ROUNDING, size
from screwgauge.diagnosis.properties import INERTIAL, PASSIVE, Change, applied, word
from screwgauge.diagnosis.transformations import axis
from screwgauge.models.formats import TENSOR
from screwgauge.models.kinematics import downwards, plant
from screwgauge.models.readings.assemble import matrix
from screwgauge.models.readings.reading import FREEDOMS, Reading
from screwgauge.reference.rotations import Array, rotation, triad
from screwgauge.witness.dynamics import inverse_dynamics
from screwgauge.witness.tree import TreeStates

#: Times the speeds at which a difference is measured, accelerations being the same.
SPEEDS = (0.0, 1.0, 2.0)
#: Share of a difference that may be there at rest as well, and how far a power may be from a whole one.
RESTS, WHOLE = 1e-3, 0.01
#: Power of speed -> what goes with it.
MEANING = {0: "dry friction", 1: "damping"}


@dataclass(frozen=True, slots=True)
class Growth:
    """Growth with speed of a difference that vanishes at rest.

    Attributes:
        power: Of speed.
        share: How much of the velocity products (Coriolis and centrifugal terms, Jdot v) is there: 0 if they are
            missing; NaN where the difference is none of a share of them.
    """

    power: float
    share: float = math.nan

    @property
    def products(self) -> bool:
        """Whether it grows as velocity products do."""
        return abs(self.power - 2.0) < WHOLE

    @property
    def sentence(self) -> str:
        """Growth in words."""
        text = f"it vanishes at rest and grows with speed to the power {self.power:.3f}"
        if not self.products:
            meaning = MEANING.get(round(self.power)) if abs(self.power - round(self.power)) < WHOLE else None
            return f"{text}, as {meaning} does" if meaning else text
        if math.isnan(self.share):
            return f"{text}: velocity products (Coriolis and centrifugal terms, Jdot v of loops) are wrong"
        fate = f"are {self.share:.6g} times what they should be" if abs(self.share) > RESTS else "are missing"
        return f"{text}: velocity products (Coriolis and centrifugal terms, Jdot v of loops) {fate}"


def growth(theirs: Sequence[Array], ours: Sequence[Array]) -> Growth | None:
    """Growth of the difference of two quantities, each at `SPEEDS`; None where it does not vanish at rest."""
    rest, once, twice = (float(np.abs(x - y).max(initial=0.0)) for x, y in zip(theirs, ours, strict=True))
    if not (0.0 < once < math.inf and 0.0 < twice < math.inf and rest <= RESTS * once):
        return None
    one, two = (each[2] - 2.0 * each[1] + each[0] for each in (theirs, ours))  # what is of second order in speed
    share = float(np.vdot(one, two) / max(float(np.vdot(two, two)), 1e-300))
    fits = float(np.abs(one - share * two).max()) <= RESTS * float(np.abs(one - two).max())
    return Growth(math.log2(twice / once), share if fits else math.nan)


#: A fit explains as much as another one if it leaves no more than this share of the difference more.
ALIKE = 1e-6
#: Step of derivatives by central differences, of a number's own size: leaves about 1e-10 of them.
STEP = 1e-6
#: Fits that are refined, and by how many steps of Gauss and Newton at most.
REFINED, STEPS = 8, 8
#: Singular values below this share of the largest are directions that the torques do not determine.
SEEN = 1e-9
#: What is left of the torque difference after some changes, over the largest torques. Shape (n n_freedom,).
Left = Callable[[Sequence[Change]], Array]


@dataclass(frozen=True, slots=True, eq=False)
class Family:
    """Values that a cause may have.

    Attributes:
        name: In words.
        typical: Size of each number. Shape (k,).
        changes: Makes the changes of steps from the values of the reading, shape (k,).
    """

    name: str
    typical: Array
    changes: Callable[[Array], tuple[Change, ...]]


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """The best of a family.

    Attributes:
        changes: That make the torques what they are.
        share: Of the torque difference that is explained.
        unseen: How many directions among its numbers the torques do not determine.
        alike: Names of others that explain as much and cannot be distinguished from it.
    """

    name: str
    changes: tuple[Change, ...]
    share: float
    unseen: int = 0
    alike: tuple[str, ...] = ()


def families(reading: Reading) -> Iterator[Family]:
    """All that are tried, by body, by joint, and of the whole."""
    masses = {name: body for name, body in reading.bodies.items() if body.mass > 0.0}
    for name in masses:
        for what in INERTIAL:
            yield _of_body(reading, name, what)
    for name, joint in reading.joints.items():
        if FREEDOMS[joint.kind] == 1:
            yield from _of_joint(reading, name)
    g = downwards(reading)
    yield Family("gravity", np.full(3, 9.81), lambda x: (Change("", "gravity", g + x),))

    def scaled(x: Array) -> tuple[Change, ...]:
        return tuple(Change(name, "mass", np.asarray(body.mass * (1.0 + x[0]))) for name, body in masses.items())

    yield Family("all masses scaled", np.ones(1), scaled)


def _of_body(reading: Reading, name: str, what: str) -> Family:
    body = reading.bodies[name]
    if what == "mass":
        return Family(
            f"mass of {name}", np.array([body.mass]), lambda x: (Change(name, what, np.asarray(body.mass + x[0])),)
        )
    if what == "com":
        return Family(f"{word(what)} of {name}", np.full(3, 0.1), lambda x: (Change(name, what, body.com + x),))

    def tensor(x: Array) -> tuple[Change, ...]:
        I = body.inertia.copy()
        for (i, j), step in zip(TENSOR.values(), x, strict=True):
            I[i, j] += step
            I[j, i] = I[i, j]
        return (Change(name, what, I),)

    return Family(f"{what} of {name}", np.full(6, float(np.abs(body.inertia).max()) or body.mass * 0.01), tensor)


def _passive(name: str, what: str, old: float) -> Family:
    return Family(f"{word(what)} of {name}", np.ones(1), lambda x: (Change(name, what, np.asarray(old + x[0])),))


def _of_joint(reading: Reading, name: str) -> Iterator[Family]:
    joint = reading.joints[name]
    for what in PASSIVE:
        yield _passive(name, what, float(getattr(joint, what)))
    yield Family(f"sign of {name}", np.zeros(0), lambda x: (Change(name, "sign", np.array(-1.0)),))
    yield Family(f"zero of {name}", np.ones(1), lambda x: (Change(name, "zero", np.asarray(joint.home + x[0])),))
    _, *across = triad(axis(joint)[None])

    def tilted(x: Array) -> tuple[Change, ...]:
        direction = axis(joint) + x[0] * across[0] + x[1] * across[1]
        return (Change(name, "axis", direction / np.linalg.norm(direction)),)

    yield Family(f"axis of {name}", np.ones(2), tilted)

    def displaced(x: Array) -> tuple[Change, ...]:
        angle = float(np.linalg.norm(x[:3]))
        R = rotation(x[:3] / angle, np.array(angle)) if angle > 0.0 else np.eye(3)
        return (Change(name, "placement", matrix(joint.centre - R @ joint.centre + x[3:], R)),)

    yield Family(f"placement of {name}", np.concatenate([np.ones(3), np.full(3, 0.1)]), displaced)


def fitted(reading: Reading, states: TreeStates, torques: Array, causes: Sequence[Family] | None = None) -> list[Fit]:
    """Causes for which the torques of a reading are not those of a black box, the one that explains most first.

    Args:
        torques: Of the black box at the states. Shape (n, n_freedom).
        causes: All `families` by default.
    """
    own = inverse_dynamics(plant(reading), states)
    scale = np.maximum(np.abs(torques).max(axis=0), 1e-3 * np.abs(torques).max())

    def left(changes: Sequence[Change]) -> Array:
        return np.asarray(((inverse_dynamics(plant(applied(reading, changes)), states) - torques) / scale).ravel())

    start = np.asarray(((own - torques) / scale).ravel())
    before = size(start)
    if before <= ROUNDING:
        return []
    first = []
    for cause in causes or families(reading):
        x, unseen = _step(cause, left, np.zeros(len(cause.typical)), start)
        first.append((cause, x, unseen, left(cause.changes(x))))
    best = sorted(first, key=lambda each: size(each[-1]))[:REFINED]
    fits = sorted((_refined(left, before, *each) for each in best), key=lambda fit: -fit.share)
    top = fits[0].share
    alike = tuple(fit.name for fit in fits[1:] if fit.share >= top - ALIKE)
    return [Fit(fits[0].name, fits[0].changes, top, fits[0].unseen, alike), *fits[1:]]


def _step(cause: Family, left: Left, x: Array, there: Array) -> tuple[Array, int]:
    """A step of Gauss and Newton from `x`, and how many directions it does not determine.

    Args:
        there: What is left at `x`.
    """
    columns = []
    for i, typical in enumerate(cause.typical):
        h = np.zeros(len(x))
        h[i] = STEP * typical
        columns.append((left(cause.changes(x + h)) - left(cause.changes(x - h))) / (2.0 * STEP))
    if not columns:
        return x, 0
    step, _, rank, _ = np.linalg.lstsq(np.stack(columns, axis=1), -there, rcond=SEEN)
    return x + step * cause.typical, len(x) - int(rank)


def _refined(left: Left, before: float, cause: Family, x: Array, unseen: int, there: Array) -> Fit:
    """The fit of a family, as long as steps bring it nearer."""
    for _ in range(STEPS if len(x) else 0):
        other, _ = _step(cause, left, x, there)
        then = left(cause.changes(other))
        if not size(then) < 0.5 * size(there):
            break
        x, there = other, then
    return Fit(cause.name, cause.changes(x), 1.0 - size(there) / before, unseen)
