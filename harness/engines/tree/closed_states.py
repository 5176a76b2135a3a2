"""States of a tree with closed loops: projection onto the loops, and conversion to joint coordinates."""

from __future__ import annotations

import numpy as np

from screwgauge.engines.chunks import JointMotion
from screwgauge.engines.tree.closed_tree import ClosedTree
from screwgauge.engines.tree.protocol import Mover
from screwgauge.reference import linear
from screwgauge.reference.closed.newton import ROUNDING
from screwgauge.reference.equations.joint_types import SURE
from screwgauge.reference.errors import SingularPoseError
from screwgauge.reference.rotations import Array, Flags, follow

#: Singular values of the closing rows below this fraction of the largest are ignored: near a singular pose of
#: the loops the minimum-norm correction would be long, in directions that the rows hardly constrain.
SMALLEST = 1e-7
MOST = 4  # two corrections suffice for a state that drifted by 1e-6


def project(mover: Mover, q: Array, v: Array) -> tuple[Array, Array, tuple[float, float, float]]:
    """Project a state onto the closed loops and set the engine to the projected state.

    Uses Newton's method with a single factorisation; the first correction reduces a drift of 1e-6 to 1e-12.

    Returns:
        Tree coordinates and rates, shape (n_v,) each, and three maxima of closing errors: of position [m or rad] and of
        rate [per s] before the projection, and of position after it.

    Raises:
        SingularPoseError: The state has grown so large that its closing errors are not finite.
    """
    mover.place(q, v)
    gaps, G = mover.closure()
    if not len(gaps):
        return q, v, (0.0, 0.0, 0.0)
    gap = left = float(np.abs(gaps).max())
    with np.errstate(invalid="ignore", over="ignore"):
        rate = float(np.abs(G @ v).max())
    if not np.isfinite([gap, rate]).all():
        raise SingularPoseError(
            "the state diverged and cannot be projected onto the closed loops", "integration", "use smaller steps"
        )
    if gap <= ROUNDING and rate <= 4 * ROUNDING * float(np.abs(v).max()):
        return q, v, (gap, rate, gap)
    inverse = _pseudo_inverse(G)
    for _ in range(MOST):
        if not ROUNDING < left < np.inf:
            break
        trial = q - inverse @ gaps
        mover.place(trial, v)
        gaps, jacobian = mover.closure()
        after = float(np.abs(gaps).max())
        if not after < left:
            mover.place(q, v)
            break
        stalled, (q, G, left) = after > 0.5 * left, (trial, jacobian, after)
        if stalled:
            break
    for _ in range(2):
        v = v - inverse @ (G @ v)
    mover.place(q, v)
    return q, v, (gap, rate, left)


def _pseudo_inverse(G: Array) -> Array:
    """Compute the pseudo-inverse from eigenvectors of G^T G, whose size does not grow with redundant rows.

    Shape (m, n) -> (n, m).
    """
    w, V = np.linalg.eigh(G.T @ G)
    kept = w > SMALLEST**2 * max(float(w[-1]), np.finfo(float).tiny)
    V = V[:, kept]
    return np.asarray((V / w[kept]) @ (V.T @ G.T))


_MEMORY = 2e7  # largest memory for the Jacobians of all bodies [bytes]


class Path:
    """States of a motion in order of time; only some of them are requested.

    Attributes:
        t, q, v: Times [s], tree coordinates and rates, one entry for each state.
        wanted: Indices of the requested states.
        a: Tree accelerations, one entry for each requested state.
    """

    def __init__(self) -> None:
        self.t, self.q, self.v = list[float](), list[Array](), list[Array]()
        self.wanted, self.a = list[int](), list[Array]()

    def add(self, t: float, q: Array, v: Array, a: Array | None = None) -> None:
        """Append a state; a state with accelerations counts as requested."""
        if a is not None:
            self.wanted.append(len(self.t))
            self.a.append(a)
        self.t.append(t)
        self.q.append(q)
        self.v.append(v)

    def cut(self, t: float) -> None:
        """Drop the states after a time."""
        n = sum(time <= t for time in self.t)
        del self.t[n:], self.q[n:], self.v[n:]
        self.wanted = [i for i in self.wanted if i < n]
        del self.a[len(self.wanted) :]


def read_path(closed: ClosedTree, path: Path, start: Array) -> JointMotion:
    """Read the requested states of a path, following the angles of cut joints through all states.

    Args:
        start: Independent coordinates at the first state of the path. Shape (k,).
    """
    q, v = np.array(path.q), np.array(path.v)
    rows, a = np.array(path.wanted, dtype=np.intp), np.array(path.a)
    turned = {name: x[rows] for name, x in _follow_angles(closed, np.array(path.t), q, v, start).items()}
    parts = [
        _part(closed, q[rows[i]], v[rows[i]], a[i], {n: x[i] for n, x in turned.items()})
        for i in _blocks(closed, len(rows))
    ]
    return JointMotion(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in ("q", "v", "a", "condition"))
    )


def _blocks(closed: ClosedTree, n: int) -> list[slice]:
    tree = closed.tree
    size = max(1, int(_MEMORY / (48 * (len(tree.bodies) + 1) * max(1, len(tree.coordinates)))))
    return [slice(i, min(n, i + size)) for i in range(0, n, size)]


def _follow_angles(closed: ClosedTree, t: Array, q: Array, v: Array, start: Array) -> dict[str, Array]:
    """Return the angles of cut joints at all states, predicting each step from the velocities."""
    loops = closed.loops
    if not loops.cut:
        return {}
    blocks: dict[str, list[tuple[Array, Array, Flags]]] = {joint.name: [] for joint in loops.cut}
    for block in _blocks(closed, len(t)):
        at = closed.tree.poses(q[block])
        charts = loops.charts(at)
        for name, rates in closed.cut_velocities(charts, at.velocities(v[block])).items():
            blocks[name].append((charts[name].q, rates, charts[name].condition < SURE))
    followed = {}
    for joint in loops.cut:
        angles, rates, sure = (np.concatenate(parts) for parts in zip(*blocks[joint.name], strict=True))
        followed[joint.name] = follow(loops.begin(joint, start), angles, sure, t, rates)
    return followed


def _part(closed: ClosedTree, q: Array, v: Array, a: Array, turned: dict[str, Array]) -> JointMotion:
    at = closed.tree.poses(q)
    charts = {name: chart.near(turned[name]) for name, chart in closed.loops.charts(at).items()}
    V, cut_a = at.velocities(v), dict[str, Array]()
    cut_v = closed.cut_velocities(charts, V)
    if charts:
        cut_a = closed.cut_accelerations(charts, cut_v, V, closed.tree.bias(at, q, v, V) + at.velocities(a))
    condition = linear.condition(closed.closing_rows(q, at, charts))
    return JointMotion(closed.joints(q, turned), closed.joints(v, cut_v), closed.joints(a, cut_a), condition)
