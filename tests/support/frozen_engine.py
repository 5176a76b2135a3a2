"""An engine of another package as it was written when `screwgauge.plugins` was made: it is never changed.

Absolute coordinates in plain NumPy: position and unit quaternion of each body, constraints between two frames of each
joint, Newton and Euler for each body.
"""

import numpy as np

from screwgauge.plugins import (
    Constrained,
    Engine,
    GivenMotion,
    ModelFileError,
    Placement,
    absolute_poses,
    acting,
    body_poses,
    check_fits,
    length,
    load_mechanism,
    matter_of,
    quiet,
    read_joints,
    required_wrenches,
    solve_constrained,
)

FROZEN = Engine(
    "frozen",
    "absolute coordinates in NumPy",
    "support.frozen_engine:load",
    frozenset((GivenMotion,)),
    "numpy",
    lacks=dict.fromkeys(("tree_force", "tree_force_soft"), "it has no tree"),
)
#: Slides along x, y and z, and pairs of axes that stay at right angles, between frames whose z is the last axis.
SLIDES = {"R": "xyz", "fixed": "xyz", "C": "xy", "P": "xy", "E": "z", "U": "xyz", "S": "xyz", "F": ""}
TURNS = {"R": ("xz", "yz"), "C": ("xz", "yz"), "E": ("xz", "yz"), "P": ("xz", "yz", "xy"), "U": ("yz",)}
TURNS |= {"fixed": TURNS["R"], "S": (), "F": ()}
WEIGHTS = ((1, 45), (2, -9), (3, 1), (-1, -45), (-2, 9), (-3, -1))


def load(files):
    return FrozenModel(load_mechanism(files.model), str(files.model))


class FrozenModel:
    def __init__(self, mechanism, where):
        self.mechanism, self.where, self.independent = mechanism, where, tuple(mechanism.independent)

    def solve(self, problem, progress=quiet):
        if not isinstance(problem.task, GivenMotion):
            raise ModelFileError("takes given motions only", self.where, "name another engine")
        check_fits(problem, self.mechanism, self.where)
        labels = "frozen", "1", "absolute coordinates"
        return solve_constrained(labels, Bodies(self.mechanism), problem, progress)


class Bodies(Constrained):
    def __init__(self, mechanism):
        self.mechanism, self.rows, L, n = mechanism, [], length(mechanism), len(mechanism.bodies)
        (R,), (p,) = body_poses(mechanism, mechanism.home[None])
        self.home = np.concatenate([[*p[i], *quaternion(R[i])] for i in range(1, n + 1)])
        self.units, units = np.tile([L, L, L, 1.0, 1.0, 1.0, 1.0], n), [1.0] * n
        for joint in mechanism.joints:
            own = [L] * len(SLIDES[joint.kind]) + [1.0] * len(TURNS[joint.kind])
            self.rows.append([*range(len(units), len(units) + len(own))])
            units += own
        self.gap_units = np.array(units)

    def place(self, x):
        parts = x.reshape(len(x), -1, 7).copy()
        norms = np.linalg.norm(parts[..., 3:], axis=2)
        parts[..., 3:] /= norms[..., None]
        at = self.placed(parts)
        at.gaps[:, : norms.shape[1]] = norms**2 - 1.0
        return at

    def placed(self, parts):
        """Polynomials in the coordinates, also where quaternions have other norms."""
        n, bodies, _ = parts.shape
        R, p, T = absolute_poses(parts)
        gaps, twists = self.joints(R, p)
        norms = np.zeros((n, bodies, bodies, 7))
        norms[:, range(bodies), range(bodies), 3:] = 2.0 * parts[..., 3:]
        G = [norms.reshape(n, bodies, -1), np.einsum("nrbs,nbsx->nrx", twists, T)]
        return Placement(R, p, T, np.concatenate([np.zeros((n, bodies)), gaps], axis=1), np.concatenate(G, axis=1))

    def joints(self, R, p):
        """Gaps of the joints, and their rates per twist of each body. Shapes (n, m), (n, m, n_body + 1, 6)."""
        gaps, rows = np.zeros((len(p), 0)), np.zeros((len(p), 0, p.shape[1], 6))
        for joint in self.mechanism.joints:
            z = joint.axes[-1]
            y = joint.axes[0] if len(joint.axes) == 2 else np.linalg.svd(z[None])[2][1]
            frame, bodies = np.stack([np.cross(y, z), y, z], axis=1), self.mechanism.body_index
            (i, a, A), (j, c, C) = (
                (bodies[name], R[:, bodies[name]] @ at.p, R[:, bodies[name]] @ at.R @ frame) for name, at in joint.sides
            )
            apart = p[:, j] + c - p[:, i] - a
            for k in ("xyz".index(axis) for axis in SLIDES[joint.kind]):
                e, row = A[:, :, k], np.zeros((*p.shape[:2], 6))
                row[:, j, :3], row[:, j, 3:] = np.cross(c, e), e
                row[:, i, :3], row[:, i, 3:] = -np.cross(a + apart, e), -e
                gaps, rows = below(gaps, np.sum(e * apart, axis=1)), below(rows, row)
            for first, second in TURNS[joint.kind]:
                e, f = A[:, :, "xyz".index(first)], C[:, :, "xyz".index(second)]
                row = np.zeros((*p.shape[:2], 6))
                row[:, i, :3], row[:, j, :3] = np.cross(e, f), -np.cross(e, f)
                gaps, rows = below(gaps, np.sum(e * f, axis=1)), below(rows, row)
        return gaps, rows

    def bias(self, x, xd):
        h = 0.1 / np.maximum(np.abs(xd).max(axis=1), 1e-9)[:, None]
        steps = [(w, (x + k * h * xd).reshape(len(x), -1, 7)) for k, w in WEIGHTS]
        G = sum(w * self.placed(parts).G for w, parts in steps) / (60.0 * h[..., None])
        return (G @ xd[..., None])[..., 0], np.zeros((len(x), len(self.mechanism.body_index), 6))

    def dynamics(self, x, xd, applied):
        at, matter = self.place(x), matter_of(self.mechanism)
        V, still = (at.T @ xd[:, None, :, None])[..., 0], np.zeros((*at.p.shape[:2], 6))
        joints = read_joints(self.mechanism, at.R, at.p)
        turned = [3, 4, 5, 0, 1, 2]  # of a wrench, beside a twist

        def along(wrenches):
            return np.einsum("nbs,nbsx->nx", wrenches[..., turned], at.T)

        unit = [required_wrenches(matter, at.R, still, at.T[..., k], np.zeros(3)) for k in range(x.shape[1])]
        wrenches = acting(applied, np.zeros(len(x)), joints, V)[0]
        needed = required_wrenches(matter, at.R, V, still, applied.g)
        return np.stack([along(one) for one in unit], axis=2), along(wrenches - needed)


def below(rows, row):
    return np.concatenate([rows, row[:, None]], axis=1)


def quaternion(R):
    """Unit quaternion of a rotation, by the eigenvector of its symmetric form."""
    K = np.zeros((4, 4))
    K[0, 0], K[1:, 1:] = np.trace(R), R + R.T - np.trace(R) * np.eye(3)
    K[0, 1:] = K[1:, 0] = [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]
    return np.linalg.eigh(K)[1][:, -1]
