"""Rules that fix the forces of redundant actuators."""

from __future__ import annotations

import numpy as np

from screwgauge.engines.tree.closure import Loops
from screwgauge.engines.tree.protocol import BodyPoses
from screwgauge.models.loops import LoopsFile
from screwgauge.reference import linear
from screwgauge.reference.dynamics import across_direction
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.rotations import Array


def axial_forces(
    file: LoopsFile, loops: Loops, at: BodyPoses, G: Array, need: Array, driven: list[int]
) -> tuple[Array, Array]:
    """Actuator forces for which the force of the spherical joint lies along its line (eq. 56).

    Args:
        G: Rows of the closures. Shape (n, m, n_v).
        need: Joint forces that actuators and closures must deliver together. Shape (n, n_v).
        driven: Columns of the actuated coordinates.

    Returns:
        Forces, shape (n, n_actuator), and the condition of the equations, (n,).

    Raises:
        ModelFileError: The joint is not among the cut ones.
    """
    name, direction = file.axial if file.axial else ("", np.zeros(3))
    columns = [k for k, anchor in enumerate(loops.anchors) if anchor.joint == name and not anchor.angular]
    joint = next((joint for joint in loops.cut if joint.name == name), None)
    if joint is None or len(columns) != 1:
        raise ModelFileError(
            f"joint '{name}' is not cut in the {file.cut} cut", "rule spherical_axial", "use the minimal cut"
        )
    n, m, nv = G.shape
    across = across_direction(at.R[:, loops.index[joint.child]], direction)
    system = np.zeros((n, nv + 2, len(driven) + m))
    system[:, driven, range(len(driven))] = 1.0
    system[:, :nv, len(driven) :] = G.swapaxes(1, 2)
    first = len(driven) + 3 * columns[0]
    system[:, nv:, first : first + 3] = across
    right = np.concatenate([need, np.zeros((n, 2))], axis=1)
    return linear.solve(system, right[..., None])[:, : len(driven), 0], linear.condition(system)
