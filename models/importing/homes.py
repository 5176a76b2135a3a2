"""Finds poses that close all loops of a reading, and chooses the best of these poses as the home pose."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwgauge.models.kinematics import ReadingTree, home, length_of
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import ClosureError, first_few
from screwgauge.reference.linear import EPS, ROUNDED
from screwgauge.reference.rotations import Array
from screwgauge.witness.constraints import gaps_and_rows, move_joints
from screwgauge.witness.tree import TreeStates

#: Number of Newton starts near the home pose, and their largest distance from it [rad or model lengths]; every second
#: start is followed by a start anywhere within the limits.
STARTS, FARTHEST, EVERY = 40, np.pi, 2
ENOUGH = 8  # number of closed poses within limits to find, if none is well conditioned
#: Largest residual of loops that count as closed in a file with few digits [rad or lengths]; it is due to rounding.
ROUNDING = 1e-5
#: Singular values of the loop equations: smallest regular value; value below which an equation counts as redundant.
REGULAR, REDUNDANT = 2e-3, 1e-8
#: Smallest singular value that counts as well conditioned: accelerations contain rounding errors of these equations,
#: multiplied by the cube of its inverse; they stay below 1e-11, the tolerance within which engines must agree.
WELL = float(np.cbrt(ROUNDED * EPS / 1e-11))
#: Margin between coordinates and their limits, as a share of the range, and its maximum [rad]: a motion needs room.
MARGIN, ROOM = 0.15, 0.3
CENTRINGS = 40
#: Number of closures or joints that a sentence names.
SHOWN = 5
OWN = "the file's own home pose"


@dataclass(frozen=True, slots=True, eq=False)
class Home:
    """A closed pose.

    Attributes:
        start: Name of the starting pose of the search.
        q: Coordinates. Shape (n_coordinate,).
        error: Largest residual of the loop equations [rad or model lengths].
        rank: Rank of the loop equations.
        least: Smallest singular value of the loop equations, ignoring redundant equations; infinite without loops.
        beyond: Joints outside their limits.
        distance: Dimensionless distance of hinges and slides from the file's own home pose.
    """

    start: str
    q: Array
    error: float
    rank: int
    least: float
    beyond: tuple[str, ...]
    distance: float

    @property
    def good(self) -> bool:
        """True if this home pose is good enough to stop the search."""
        return not self.beyond and self.least > WELL

    def key(self) -> tuple[int, bool, int, float, float]:
        """Return a sort key, which is smallest for the best home pose."""
        singular = self.least <= REGULAR
        return -self.rank, singular, len(self.beyond), -min(self.least, WELL), self.distance


def choose_home(loops: Loops, keyframes: Mapping[str, Mapping[str, float]], where: str) -> tuple[Home, tuple[str, ...]]:
    """Choose the best closed pose: regular, within limits, well conditioned and near the file's own home pose.

    The search keeps the file's own home pose if it is closed, regular and within limits.

    Args:
        keyframes: Further poses in the file: name -> joint -> coordinate [rad or m].

    Returns:
        The pose, and sentences that explain why it is not the closed pose nearest to the file's own home pose.

    Raises:
        ClosureError: A loop does not close from any starting pose.
    """
    homes, nearest, tried = list[Home](), (loops.home, np.inf), 0
    for start, begin in starts(loops, keyframes):
        tried += 1
        q, error = loops.newton(begin)
        nearest = min(nearest, (q, error), key=lambda pair: pair[1])
        if not error <= ROUNDING:
            continue
        homes.append(one := measure(loops, start, *_centre(loops, q, error)))
        kept = begin is loops.home and q is begin  # the file's own home pose is closed
        fine = [each for each in homes if not each.beyond and each.least > REGULAR]
        if one.good or (kept and one in fine) or len(fine) == ENOUGH:
            break
    if not homes:
        open_by = few_of(loops.gaps(nearest[0], ROUNDING))
        what = f"loops do not close from any of {tried} starts; the smallest gaps are {open_by}"
        raise ClosureError(what, where, "check the frames of the closures, or remove closures")
    best = min(homes, key=Home.key)
    return best, tuple(_reasons(best, homes))


def _reasons(best: Home, homes: Sequence[Home]) -> Iterator[str]:
    """Explain why the chosen pose was not found from the file's own home pose."""
    if best.start == OWN:
        return
    what = "nearest well-conditioned" if best.least > WELL else "best-conditioned"
    inside = "" if best.beyond else " within the limits"
    reason = (
        f"Of {len(homes)} closed poses, the home pose is the {what} pose{inside}, found from {best.start}; "
        "the smallest singular"
    )
    reason = f"{reason} value of the loop equations there is {best.least:.2g}."
    if (own := homes[0]).start != OWN:
        yield f"{reason} From {OWN}, the loops do not close."
        return
    kept = f", with {few_of(own.beyond)} outside limits" if own.beyond else ""
    yield f"{reason} From {OWN}, the loops close at a pose where this value is {own.least:.2g}{kept}."


def starts(loops: Loops, keyframes: Mapping[str, Mapping[str, float]]) -> Iterator[tuple[str, Array]]:
    """Yield named starting coordinates for closing the loops; joints outside loops keep their home coordinates."""
    yield OWN, loops.home
    for name, pose in keyframes.items():
        q = loops.home.copy()
        for joint, place in loops.tree.places.items():
            if joint in pose and place.stop - place.start == 1:
                q[place] = pose[joint]
        yield f"keyframe '{name}'", q
    bounded = [name for name, (low, high) in limits(loops) if low < high and np.isfinite([low, high]).all()]
    bounded = [name for name in bounded if loops.closing[loops.tree.freedoms[name]].any()]
    near, inside = np.random.default_rng(0), np.random.default_rng(1)
    if bounded:
        yield "the middle of the joint ranges", _interpolate(loops, bounded, np.full(len(bounded), 0.5))
    for i in range(1, STARTS):
        step = FARTHEST * i / (STARTS - 1) * near.uniform(-1.0, 1.0, len(loops.closing))
        yield "a random pose near the file's own home pose", loops.move(loops.home, loops.closing * step)
        if bounded and i % EVERY == 0:
            yield "a random pose within the limits", _interpolate(loops, bounded, inside.uniform(size=len(bounded)))


def _interpolate(loops: Loops, names: Sequence[str], share: Array) -> Array:
    """Return home coordinates with named joints moved to fractions of their ranges. `share`: fractions, shape (n,)."""
    q = loops.home.copy()
    for name, part in zip(names, share, strict=True):
        low, high = loops.reading.joints[name].limits
        q[loops.tree.places[name]] = low + part * (high - low)
    return q


def measure(loops: Loops, start: str, q: Array, error: float) -> Home:
    """Compute the properties by which a closed pose is ranked."""
    rank, least = _rank(loops, q)
    return Home(start, q, error, rank, least, tuple(joints_beyond(loops, q)), _distance(loops, q))


def _rank(loops: Loops, q: Array) -> tuple[int, float]:
    """Compute the rank of the loop equations and their smallest singular value, ignoring redundant equations."""
    s = np.linalg.svd(loops.system(q)[1], compute_uv=False)
    rank = int(np.sum(s > REDUNDANT))
    return rank, float(s[rank - 1]) if rank else np.inf


def limits(loops: Loops) -> list[tuple[str, tuple[float, float]]]:
    """Return the limits of all joints."""
    return [(name, joint.limits) for name, joint in loops.reading.joints.items()]


def joints_beyond(loops: Loops, q: Array) -> list[str]:
    """List the joints outside their limits."""
    at = loops.values(q)
    return [name for name, (low, high) in limits(loops) if name in at and low < high and not low <= at[name] <= high]


def _is_at_limit(loops: Loops, q: Array) -> bool:
    """Return True if a joint is at or beyond a limit."""
    at = loops.values(q)
    return any(name in at and low < high and not low < at[name] < high for name, (low, high) in limits(loops))


def few_of(phrases: Sequence[str]) -> str:
    """List the first phrases and count the remaining phrases."""
    return first_few(phrases, SHOWN)


def _distance(loops: Loops, q: Array) -> float:
    home, parts = loops.values(loops.home), loops.tree.freedoms
    way = [(value - home[name]) / loops.size[parts[name]][0] for name, value in loops.values(q).items()]
    return float(np.linalg.norm(way))


def _centre(loops: Loops, q: Array, error: float) -> tuple[Array, float]:
    """Move coordinates away from their limits as far as possible while keeping the loops closed."""
    for _ in range(CENTRINGS):
        wish = _wish(loops, q)
        if not wish.any():
            break
        rank, least = _rank(loops, q)
        if rank:
            Vt = np.linalg.svd(loops.system(q)[1])[2]
            wish = Vt[rank:].T @ (Vt[rank:] @ wish)
        wish *= min(1.0, 0.3 / max(float(np.abs(wish).max()), 1e-300))
        if np.abs(wish).max() < 1e-6:
            break
        trial, left = loops.newton(loops.move(q, wish))
        # within limits, good conditioning outweighs the margin, but a joint at a limit cannot move
        floor = REGULAR if _is_at_limit(loops, q) else min(least, WELL)
        worse = rank and _rank(loops, trial)[1] < floor
        if not left <= max(error, 1e-9) or worse or _lack(loops, trial) >= _lack(loops, q):
            break
        q, error = trial, left
    return q, error


def _wish(loops: Loops, q: Array) -> Array:
    """Return the dimensionless step that would give all coordinates the required margin to their limits. Shape (n,)."""
    wish = np.zeros(len(loops.size))
    for name, x in loops.values(q).items():
        joint = loops.reading.joints[name]
        low, high = joint.limits
        if not low < high:
            continue
        room = MARGIN * (high - low)
        room = room if joint.kind == "slide" and np.isfinite(room) else min(room, ROOM)
        wish[loops.tree.freedoms[name]] = float(np.clip(x, low + room, high - room)) - x
    return wish / loops.size


def _lack(loops: Loops, q: Array) -> float:
    return float(np.linalg.norm(_wish(loops, q)))


#: Largest residual of a closed loop [rad or model lengths]; descriptions are only checked to 1e-9.
CLOSED = 1e-11
MINOR = 1e-3  # share of a gap below which its part in the second unit (rad or m) is not mentioned
STEPS = 100
STUCK = 8  # number of steps without an improvement of 1 % after which the iteration stops
LARGEST = 0.4  # step [rad or lengths]
LATEST = 8  # number of poses whose equations are cached: evaluating a step needs them again


@dataclass(frozen=True, eq=False)
class Loops:
    """The loop equations of a tree, with distances in model lengths; coordinates have shape (n_coordinate,).

    Attributes:
        held: Joints that are locked at their home coordinates.
    """

    tree: ReadingTree
    held: frozenset[str] = frozenset()

    @property
    def reading(self) -> Reading:
        """Reading of the tree."""
        return self.tree.reading

    @cached_property
    def home(self) -> Array:
        """Coordinates at the home pose."""
        return np.asarray(home(self.reading).q[0])

    def values(self, q: Array) -> dict[str, float]:
        """Return hinge or slide -> coordinate [rad or m]."""
        places = self.tree.places.items()
        return {name: float(q[place.start]) for name, place in places if place.stop - place.start == 1}

    @cached_property
    def length(self) -> float:
        """Unit of distances [m]."""
        return length_of(self.reading)

    @cached_property
    def size(self) -> Array:
        """Unit of each velocity: 1 for angles, the model's length for distances. Shape (n_freedom,)."""
        turn, slide = [1.0], [self.length]
        kinds = {"hinge": turn, "slide": slide, "ball": 3 * turn, "free": 3 * turn + 3 * slide}
        return np.array([unit for joint in self.reading.joints.values() for unit in kinds[joint.kind]])

    @cached_property
    def units(self) -> dict[str, Array]:
        """Closure or coupling -> unit of each of its residuals. Shape (3,), (6,) or (1,)."""
        turn, way, joints = [1.0] * 3, [self.length] * 3, self.reading.joints
        units = {name: way if c.kind == "point" else turn + way for name, c in self.reading.closures.items()}
        for name, coupling in self.reading.couplings.items():
            units[name] = way[:1] if joints[coupling.joint].kind == "slide" else turn[:1]
        return {name: np.array(some) for name, some in units.items()}

    @cached_property
    def free(self) -> Array:
        """Mask of velocities: 0 for locked joints, 1 for all others. Shape (n_freedom,)."""
        free = np.ones(len(self.size))
        for name in self.held:
            free[self.tree.freedoms[name]] = 0.0
        return free

    @cached_property
    def closing(self) -> Array:
        """Mask of velocities: 1 for free joints in a loop or coupling, 0 for all others. Shape (n_freedom,)."""
        moves = dict(zip(self.reading.bodies, self.tree.moves, strict=True))
        out, still = np.zeros(len(self.size)), np.zeros(len(self.size))
        for closure in self.reading.closures.values():
            out += np.abs(moves.get(closure.second, still) - moves.get(closure.first, still))
        for coupling in self.reading.couplings.values():
            for joint in coupling.named:
                out[self.tree.freedoms[joint]] = 1.0
        return np.minimum(out, 1.0) * self.free

    def residuals(self, q: Array) -> dict[str, Array]:
        """Compute the residuals of each closure and coupling [rad or lengths]: 3, 6 or 1 components."""
        ends = np.cumsum([len(units) for units in self.units.values()])
        return dict(zip(self.units, np.split(self.system(q)[0], ends[:-1]), strict=True)) if self.units else {}

    def gaps(self, q: Array, least: float) -> list[str]:
        """List descriptions of the gaps of open closures and couplings, from the widest to the narrowest gap."""
        widest_first = sorted(self.residuals(q).items(), key=lambda entry: -np.abs(entry[1]).max())
        return [self._gap(name, r) for name, r in widest_first if np.abs(r).max() > least]

    def _gap(self, name: str, r: Array) -> str:
        if len(r) > 1:
            gaps = {"rad": float(np.linalg.norm(r[:-3])), "m": float(np.linalg.norm(r[-3:]))}
            least = max(CLOSED, MINOR * max(gaps.values()))
            sizes = [
                f"{gap * (self.length if unit == 'm' else 1.0):.2g} {unit}" for unit, gap in gaps.items() if gap > least
            ]
            return f"'{name}' by {' and '.join(sizes)}"
        slides = self.reading.joints[self.reading.couplings[name].joint].kind == "slide"
        return f"'{name}' by {abs(r[0]) * self.length:.2g} m" if slides else f"'{name}' by {abs(r[0]):.2g} rad"

    def system(self, q: Array) -> tuple[Array, Array]:
        """Compute the dimensionless residuals and their Jacobian. Shapes (m,), (m, n_freedom)."""
        key = q.tobytes()
        if key not in self._latest:
            if len(self._latest) == LATEST:
                del self._latest[next(iter(self._latest))]
            self._latest[key] = self._system(q)
        return self._latest[key]

    @cached_property
    def _latest(self) -> dict[bytes, tuple[Array, Array]]:
        return {}

    def _system(self, q: Array) -> tuple[Array, Array]:
        rest, unit = np.zeros((1, len(self.size))), np.concatenate([np.zeros(0), *self.units.values()])
        (gap,), (rows,) = gaps_and_rows(self.tree, TreeStates(q[None], rest, rest))
        return gap / unit, rows / unit[:, None] * self.size * self.free

    def move(self, q: Array, step: Array) -> Array:
        """Return the coordinates after a dimensionless step of shape (n_freedom,)."""
        return np.asarray(move_joints(self.tree, q[None], (step * self.size)[None])[0])

    def newton(self, q: Array) -> tuple[Array, float]:
        """Close the loops by minimum-norm steps from given coordinates (Levenberg-Marquardt).

        Returns:
            Final coordinates and their largest residual.
        """
        r, J = self.system(q)
        damping, stuck = 1e-3, 0
        for _ in range(STEPS):
            error = float(np.abs(r).max(initial=0.0))
            if error <= CLOSED or damping > 1e6 or stuck > STUCK:
                break
            U, s, Vt = np.linalg.svd(J, full_matrices=False)
            step = -Vt.T @ (s / (s * s + damping * min(float(r @ r), 1.0) + 1e-16) * (U.T @ r))
            step *= min(1.0, LARGEST / max(float(np.abs(step).max(initial=0.0)), 1e-300))
            trial = self.move(q, step)
            r_trial, J_trial = self.system(trial)
            if r_trial @ r_trial < r @ r:
                stuck = stuck + 1 if r_trial @ r_trial > 0.99 * (r @ r) else 0
                q, r, J, damping = trial, r_trial, J_trial, damping / 10.0
            else:
                damping, stuck = max(damping, 1e-8) * 10.0, stuck + 1
        return q, float(np.abs(r).max(initial=0.0))
