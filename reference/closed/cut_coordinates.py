"""Coordinates of the joints that close the loops, each from the motion of its own two bodies.

They are no unknowns of the loops. Where the axes of a spherical joint come to lie in one plane (gimbal lock), its
velocities are lost, and only they.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference import linear
from screwgauge.reference.pose import Layout, side_frames
from screwgauge.reference.rotations import Array, cross, nearest_angles, triad, triad_angles


@dataclass(frozen=True, slots=True, eq=False)
class CutColumns:
    """The coordinates of the cut joints, in the order of `Layout.cut_columns`; places refer to that order.

    Attributes:
        triads: The axes of each cut joint, completed to three. Shape (n_cut, 3, 3).
        few: Whether it was fewer. Shape (n_cut,).
        angles: (places, cut joints, numbers of the angle) of all angles.
        slides: (places, cut joints) of all distances.
        slide_axes: Axes of these in the parent side's frame. Shape (n_slide, 3).
        balls: (places of three angles, cut joint) of each spherical joint.
        owner: Cut joint of each place.
    """

    triads: Array
    few: NDArray[np.bool_]
    angles: tuple[list[int], list[int], list[int]]
    slides: tuple[list[int], list[int]]
    slide_axes: Array
    balls: tuple[list[list[int]], list[int]]
    owner: list[int]


def cut_columns(lay: Layout) -> CutColumns:
    """Sorts the coordinates of the cut joints by what they are."""
    cuts = list(enumerate(lay.tree.cuts))
    freedoms = [(c, i, turns, axis) for c, joint in cuts for i, (turns, axis) in enumerate(joint.freedoms)]
    owner = [c for c, *_ in freedoms]
    angles = [(place, c, i) for place, (c, i, turns, _) in enumerate(freedoms) if turns]
    slides = [place for place, (_, _, turns, _) in enumerate(freedoms) if not turns]
    balls = [c for c, joint in cuts if joint.kind == "S"]
    return CutColumns(
        triads=np.array([triad(joint.axes) for _, joint in cuts], dtype=lay.path.dtype).reshape(-1, 3, 3),
        few=np.array([len(joint.axes) < 3 for _, joint in cuts], dtype=bool),
        angles=([place for place, _, _ in angles], [c for _, c, _ in angles], [i for _, _, i in angles]),
        slides=(slides, [owner[place] for place in slides]),
        slide_axes=np.array([freedoms[place][3] for place in slides]).reshape(-1, 3),
        balls=([[owner.index(c) + k for k in range(3)] for c in balls], balls),
        owner=owner,
    )


def read(lay: Layout, cut: CutColumns, R: Array, p: Array, guess: Array) -> Array:
    """Joint coordinates in which those of the cut joints are what the bodies' poses say.

    Args:
        R, p: Poses of the bodies. Shapes (n, n_body + 1, 3, 3), (n, n_body + 1, 3).
        guess: Joint coordinates; of all angles that mean the same, the nearest is taken. Shape (n, n_q).

    Returns:
        Shape (n, n_q).
    """
    q = guess.copy()
    if not cut.owner:
        return q
    columns = np.array(lay.cut_columns)
    (R_from, start), (R_to, end) = (side_frames(side, R, p) for side in lay.sides)
    place, owner, number = cut.angles
    near = np.zeros((*R_from.shape[:2], 3), dtype=q.dtype)
    near[:, owner, number] = guess[:, columns[place]]
    angles = triad_angles(R_from.swapaxes(-1, -2) @ R_to, cut.triads, cut.few)
    q[:, columns[place]] = nearest_angles(angles, near)[0][:, owner, number]
    if cut.slides[0]:
        place, owner = cut.slides
        along = (R_from[:, owner] @ cut.slide_axes[..., None])[..., 0]
        q[:, columns[place]] = np.sum(along * (end - start)[:, owner], axis=-1)
    return q


def readers(lay: Layout, cut: CutColumns, S: Array, points: Array) -> tuple[Array, Array]:
    """What reads the velocities of cut joints from the twist of their child less that of their parent.

    Args:
        S: Unit screws of all coordinates. Shape (n, n_q, 6).
        points: Where each cut joint acts, in the world [m]. Shape (n, n_cut, 3).

    Returns:
        Rows for twists at O, NaN in gimbal lock, in the order of `Layout.cut_columns`, shape (n, n_place, 6), and
        the condition number of each joint's orientation coordinates, shape (n, n_cut).
    """
    screws = S[:, lay.cut_columns]
    rows = np.zeros_like(screws)
    condition = np.ones(points.shape[:2])
    place = cut.angles[0]
    rows[:, place, :3] = screws[:, place, :3]  # one axis, or two at right angles
    if cut.balls[1]:
        axes = screws[:, cut.balls[0], :3]
        faces = cross(axes[:, :, [1, 2, 0]], axes[:, :, [2, 0, 1]])
        volume = np.sum(axes[:, :, 0] * faces[:, :, 0], axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            dual = faces / volume[..., None, None]
            size = 3.0**-0.5 * np.linalg.norm(dual, axis=(-2, -1))
        dual[~(size <= linear.SINGULAR)] = np.nan
        rows[:, cut.balls[0], :3], condition[:, cut.balls[1]] = dual, size
    if cut.slides[0]:
        place, owner = cut.slides
        along = screws[:, place, 3:]
        rows[:, place, 3:], rows[:, place, :3] = along, cross(points[:, owner], along)
    return rows, condition
