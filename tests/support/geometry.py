"""Rotations, screws and the linear algebra under them."""

from __future__ import annotations

from screwgauge.models.formats import number_text, quaternion, rpy
from screwgauge.reference import linear
from screwgauge.reference.equations import screws
from screwgauge.reference.equations.screws import couple, force, prismatic, revolute
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
