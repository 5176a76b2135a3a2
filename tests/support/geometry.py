"""Rotations, screws and the linear algebra under them."""

import numpy as np

from screwgauge.models.formats import number_text, quaternion, rpy
from screwgauge.reference import linear
from screwgauge.reference.equations import screws
from screwgauge.reference.equations.screws import couple, force
from screwgauge.reference.expressions import number, rotation_matrix
from screwgauge.reference.linear import EPS, SINGULAR, condition
from screwgauge.reference.rotations import (
    MIDDLE,
    Array,
    follow,
    quaternion_rotation,
    rotation,
    sequence_angles,
    skew,
    vee,
    within_half_turn,
)


def revolute(e: Array, r: Array) -> Array:
    return screws.unit_screws(np.array([True]), e[None], r[None])[0]


def prismatic(e: Array) -> Array:
    return screws.unit_screws(np.array([False]), e[None], e[None])[0]
