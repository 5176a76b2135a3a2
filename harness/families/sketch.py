"""Sketches a mechanism at its home pose by joint points and axes in the world frame, and generates its description."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from string import ascii_letters
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from screwgauge.models.formats import TENSOR
from screwgauge.reference.mechanism import GROUND, KINDS
from screwgauge.reference.rotations import Array, rotation

Tables = dict[str, Any]
#: Singular values below `ZERO` are zero, and above `REGULAR` nonzero; sketches with values in between are discarded.
ZERO, REGULAR = 1e-9, 5e-3


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A joint at the home pose between bodies `a` and `b`, with its point and axes. Shapes (3,), (n_axes, 3)."""

    kind: str
    a: str
    b: str
    point: Array
    axes: Array
    driven: bool

    @property
    def freedoms(self) -> list[tuple[bool, Array]]:
        """A pair for each degree of freedom: True for rotation, and its axis. The pairs of a C joint share an axis."""
        turns = KINDS[self.kind]
        return [(turn, self.axes[min(i, len(self.axes) - 1)]) for i, turn in enumerate(turns)]

    def tilt(self) -> float:
        """Return the second angle of an S joint: the deviation of its third axis from the normal of the first two."""
        first, second, third = self.axes
        normal = np.cross(first, second) * np.sign(np.cross(first, second) @ third)
        return float(np.arctan2(np.cross(normal, third) @ second, normal @ third))

    def zero_axes(self, home: Array, W: Array) -> tuple[Array, Array, Array]:
        """Return the axes at zero coordinates, and the rotation and displacement from zero to the home coordinates.

        Args:
            W: Rotation of the sketch.

        Returns:
            Shapes (n_axes, 3), (3, 3), (3,).
        """
        axes, turn, slide = list[Array](), np.eye(3), np.zeros(3)
        for (turns, axis), value in zip(self.freedoms, home, strict=True):
            axes.append(turn.T @ W @ axis)  # undo the rotation by the preceding degrees of freedom
            if turns:
                turn = turn @ rotation(axes[-1], np.array(value))
            else:
                slide += value * W @ axis
        return np.array(axes[: len(self.axes)]), turn, slide

    def screws(self) -> Array:
        """Return the unit screws of b relative to a about the world origin. Shape (n, 6)."""
        pairs = [(axis, np.cross(self.point, axis)) if turn else (np.zeros(3), axis) for turn, axis in self.freedoms]
        return np.array(pairs).reshape(-1, 6)


@dataclass(slots=True)
class Sketch:
    """A mechanism under construction at its home pose, to which a family adds joints; lengths are about 1 m.

    Attributes:
        rng: Source of all randomness.
        joints: Joints placed so far.
        ties: Couplings about the home pose, row -> {row: (slope, bend)}: a coordinate moves by the sum of slope x +
            bend x^2 over the coordinates that move by x. A row is the index of a coordinate among those of all joints.
    """

    rng: np.random.Generator
    joints: list[Placed] = field(default_factory=list)
    ties: dict[int, dict[int, tuple[float, float]]] = field(default_factory=dict)

    @property
    def bodies(self) -> list[str]:
        return sorted({name for joint in self.joints for name in (joint.a, joint.b)} - {GROUND})

    def unit(self) -> Array:
        """Draw a random direction. Shape (3,)."""
        v = self.rng.normal(size=3)
        return np.asarray(v / np.linalg.norm(v))

    def draw_rotation(self) -> Array:
        """Draw a random rotation. Shape (3, 3)."""
        first, second = self.axes("U")
        return np.stack([first, second, np.cross(first, second)])

    def off_axis(self, direction: Array, least: float = 0.6) -> Array:
        """Draw a unit axis whose angle to a direction has at least a given sine. Shape (3,)."""
        while True:
            axis = self.unit()
            if np.linalg.norm(np.cross(axis, direction / np.linalg.norm(direction))) >= least:
                return axis

    def axes(self, kind: str, first: Array | None = None) -> Array:
        """Draw the axes of a joint at the home pose, optionally with a given first axis. Shape (n_axes, 3)."""
        n = max(1, sum(KINDS[kind]))
        first = self.unit() if first is None else first
        second = np.cross(first, self.off_axis(first))
        second /= np.linalg.norm(second)
        third = rotation(second, np.array(self.rng.uniform(-0.5, 0.5))) @ np.cross(first, second)
        return np.stack([first, second, third])[:n]

    def join(self, kind: str, a: str, b: str, point: Array, axes: Array | None = None, *, driven: bool = False) -> None:
        """Place a joint with given axes, (3,) for the first axis or (n_axes, 3) for all; missing axes are drawn."""
        axes = self.axes(kind, axes) if axes is None or axes.ndim == 1 else axes
        self.joints.append(Placed(kind, a, b, point, axes, driven))

    def chain_names(self, a: str, b: str, n: int) -> list[str]:
        """Return the names of the bodies that n joints in series connect: a, new bodies, and b."""
        return [a, *(f"{len(self.joints)}-{i}" for i in range(n - 1)), b]

    def place(
        self, kinds: str, names: Sequence[str], places: Iterable[tuple[Array, Array | None]], driven: int | None = None
    ) -> None:
        """Place joints in series between bodies, at points and along axes, see `join`."""
        for i, (kind, (point, axes)) in enumerate(zip(kinds, places, strict=True)):
            self.join(kind, names[i], names[i + 1], point, axes, driven=i == driven)

    def chain(self, kinds: str, a: str, b: str, points: Array, *, driven: int | None = None) -> None:
        """Place joints in series from a to b at given points, P joints along the chain. Shape (n_joints, 3)."""
        ways = [points[min(i + 1, len(kinds) - 1)] - points[max(i - 1, 0)] for i in range(len(kinds))]
        axes = (
            way / np.linalg.norm(way) if kind == "P" else self.off_axis(way) if way.any() else None
            for kind, way in zip(kinds, ways, strict=True)
        )
        self.place(kinds, self.chain_names(a, b, len(kinds)), zip(points, axes, strict=True), driven)

    @property
    def firsts(self) -> list[int]:
        """Row of each joint's first coordinate, followed by the total number of coordinates."""
        return [0, *np.cumsum([len(KINDS[joint.kind]) for joint in self.joints]).tolist()]

    def tie(self, row: int, *leads: int) -> None:
        """Couple a coordinate to `leads` at similar speed; a coupling to one lead is nonlinear in half the cases."""
        self.ties[row] = {}
        for of in leads:
            slope = self.rng.uniform(0.3, 1.5) * self.rng.choice([-1, 1])
            bend = 0.0 if len(leads) > 1 else self.rng.choice([0.0, 0.3])
            self.ties[row][of] = float(slope), float(bend)

    def flip(self) -> None:
        """Exchange parent and child of random joints."""
        for i, joint in enumerate(self.joints):
            if self.rng.random() < 0.5:
                self.joints[i] = replace(joint, a=joint.b, b=joint.a, axes=joint.axes[::-1])

    def freedoms(self) -> Array | None:
        """Return a basis of the feasible joint velocities at the home pose; None if the rank is ambiguous.

        Returns:
            Orthonormal columns, with rows in the order of the joints. Shape (n_q, n_freedoms).
        """
        S, place = [joint.screws() for joint in self.joints], {name: i for i, name in enumerate(self.bodies)}
        n, ends = sum(map(len, S)), np.zeros((len(S), len(place) + 1))
        for i, joint in enumerate(self.joints):  # twist of b - twist of a - screws . rates = 0
            ends[i, place.get(joint.a, -1)], ends[i, place.get(joint.b, -1)] = 1.0, -1.0
        A = np.hstack([block_diag(*(screws.T for screws in S)), np.kron(ends[:, :-1], np.eye(6))])
        tied = np.zeros((len(self.ties), A.shape[1]))
        for equation, (row, leads) in zip(tied, self.ties.items(), strict=True):
            equation[row] = 1.0
            for of, (slope, _) in leads.items():
                equation[of] = -slope
        _, s, Vt = np.linalg.svd(np.vstack([A, tied]))
        if ((s > ZERO) & (s < REGULAR)).any():
            return None
        Q, R = np.linalg.qr(Vt[int((s > ZERO).sum()) :, :n].T)
        return Q if np.abs(np.diag(R)).min(initial=1.0) > REGULAR else None


def draw_name(rng: np.random.Generator, used: set[str], parts: Sequence[str] = ("", "-", "_", ".", "+", ":")) -> str:
    """Draw an unused name, and mark it as used."""
    while True:
        name = "".join(rng.choice(list(ascii_letters), size=rng.integers(1, 6)))
        name += f"{rng.choice(parts)}{rng.integers(0, 100)}" if rng.random() < 0.5 else ""
        if name.lower() not in {*used, GROUND, "world", "environment"}:
            used.add(name.lower())
            return name


def describe(sketch: Sketch, name: str) -> tuple[Tables, list[list[str]]]:
    """Make a description with random frames, bodies and names, in random order.

    One description in four is plain: its frames are parallel to the world frame and its home coordinates are zero, so
    that its numbers close redundant loops exactly.

    Returns:
        The tables without ``independent``, and the coordinate names of each joint, in the sketch's order.
    """
    rng, used = sketch.rng, set[str]()
    plain = rng.random() < 0.25
    W, origin = (np.eye(3), np.zeros(3)) if plain else (sketch.draw_rotation(), rng.normal(size=3))
    frames, names, bodies = {GROUND: (np.eye(3), np.zeros(3))}, {GROUND: GROUND}, {}
    for body in sketch.bodies:
        cloud = np.array([W @ joint.point + origin for joint in sketch.joints if body in (joint.a, joint.b)])
        middle = cloud.mean(axis=0) + 0.1 * rng.normal(size=3)
        R, p = frames[body] = (W, origin) if plain else (sketch.draw_rotation(), middle + 0.3 * rng.normal(size=3))
        names[body] = draw_name(rng, used)
        bodies[names[body]] = _body(rng, R.T @ (middle - p))
    joints, coordinates, homes = {}, [], list[float]()
    for placed in sketch.joints:
        n, label = len(KINDS[placed.kind]), draw_name(rng, used)
        names_of_joint = [draw_name(rng, used) for _ in range(n)] if rng.random() < 0.3 else []
        coordinates.append(names_of_joint or ([label] if n == 1 else [f"{label}.q{i + 1}" for i in range(n)]))
        home = np.zeros(n) if plain else rng.uniform(-0.5, 0.5, n)
        if placed.kind == "S":  # the angle between the third axis and the normal is the second coordinate
            home[1] = placed.tilt()
        homes += home.tolist()
        axes, turn, slide = placed.zero_axes(home, W)
        J, point = np.eye(3) if plain else sketch.draw_rotation(), W @ placed.point + origin
        joints[label] = {
            "kind": placed.kind,
            "parent": names[placed.a],
            "child": names[placed.b],
            "axes": (axes @ J).tolist(),
            "parent_frame": _frame(frames[placed.a], J, point),
            "child_frame": _frame(frames[placed.b], turn @ J, point + slide),
            **({"home": home.tolist()} if home.any() else {}),
            **({"coordinates": names_of_joint} if names_of_joint else {}),
            **({"actuated": True} if placed.driven else {}),
        }
    tables = {"name": name, "bodies": shuffle(rng, bodies), "joints": shuffle(rng, joints)}
    flat, couplings = [name for names_of_joint in coordinates for name in names_of_joint], {}
    for row, leads in sketch.ties.items():  # coordinates may be nonzero at home
        terms, constant = dict[str, list[float]](), homes[row]
        for of, (slope, bend) in leads.items():
            x = homes[of]
            terms[flat[of]] = [constant - slope * x + bend * x * x, slope - 2.0 * bend * x, bend]
            constant = 0.0
        (lead, polynomial), *more = terms.items()
        law: Tables = {"terms": terms} if more else {"of": lead, "polynomial": polynomial}
        couplings[draw_name(rng, used)] = {"coordinate": flat[row], **law}
    if couplings:
        tables["couplings"] = shuffle(rng, couplings)
    return tables, coordinates


def shuffle(rng: np.random.Generator, table: Tables) -> Tables:
    """Shuffle the entries of a table."""
    keys = list(table)
    return {keys[i]: table[keys[i]] for i in rng.permutation(len(keys))}


def _frame(body: tuple[Array, Array], R: Array, point: Array) -> Tables:
    """Transform a frame from world coordinates to the coordinates of a body frame."""
    turn = body[0].T @ R
    table: Tables = {"position": (body[0].T @ (point - body[1])).tolist()}
    return table if np.array_equal(turn, np.eye(3)) else {**table, "rotation": {"matrix": turn.tolist()}}


def _body(rng: np.random.Generator, com: Array) -> Tables:
    """Draw a body with the mass properties of a random point cloud, so that its inertia tensor is physical."""
    mass = float(np.exp(rng.uniform(-1.5, 1.5)))
    spread = 0.15 * rng.normal(size=(3, 6))
    C = mass * (spread @ spread.T) / 6
    I = np.trace(C) * np.eye(3) - C
    entries = {name: float(I[place]) for name, place in TENSOR.items()}
    return {"mass": mass, "com": com.tolist(), "inertia": entries}
