"""Balance of a mechanism that contacts hold, from the motion that an engine answers, without its forces."""

from collections.abc import Sequence

import numpy as np

from screwgauge import Results, Scene
from screwgauge.reference.graph import layout
from screwgauge.witness.joints import mechanism_tree
from screwgauge.witness.kinematics import move
from screwgauge.witness.tree import TreeStates

G = np.array([0.0, 0.0, -9.81])


def needed(scene: Scene, results: Results, engine: str) -> np.ndarray:
    """Force and moment about the world's origin that weight and inertia of all bodies take. Shape (n, 6)."""
    mechanism, states = scene.mechanism, []
    columns = mechanism.columns(mechanism.moving)
    for order in ("position", "velocity", "acceleration"):
        x = np.zeros((len(scene.t), len(mechanism.coordinates)))
        x[:, columns] = results.values(f"joint_{order}", engine)
        states.append(x)
    at = move(mechanism_tree(mechanism, layout(mechanism)), TreeStates(*states)).com
    force = mechanism.masses[:, None] * (at.a - G)
    I = at.R @ mechanism.inertias @ at.R.swapaxes(-1, -2)
    spin = np.einsum("nbij,nbj->nbi", I, at.b) + np.cross(at.w, np.einsum("nbij,nbj->nbi", I, at.w))
    return np.concatenate([force.sum(axis=1), (np.cross(at.p, force) + spin).sum(axis=1)], axis=1)


def held(scene: Scene, results: Results, engine: str, welds: Sequence[str]) -> np.ndarray:
    """Force and moment about the world's origin that welded contacts exert. Shape (n, 6)."""
    names, values = [*results.components("reaction")], results.values("reaction", engine)
    total = np.zeros((len(values), 6))
    for weld in welds:
        wrench = values[:, [names.index(f"{weld}.{label}") for label in ("fx", "fy", "fz", "mx", "my", "mz")]]
        place = scene.mechanism.joint(weld).parent_frame.p
        total += np.concatenate([wrench[:, :3], wrench[:, 3:] + np.cross(place, wrench[:, :3])], axis=1)
    return total


def unbalanced(scene: Scene, results: Results, engine: str, welds: Sequence[str]) -> float:
    """Share of the largest force, or moment, by which contacts do not carry what weight and inertia take."""
    need = needed(scene, results, engine)
    off = np.abs(held(scene, results, engine, welds) - need)
    parts = (slice(0, 3), slice(3, 6))
    return max(float(off[:, part].max() / np.abs(need[:, part]).max()) for part in parts)
