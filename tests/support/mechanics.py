"""Two models paired part by part, each in the terms of the other, and their torques."""

from __future__ import annotations

from screwgauge.diagnosis.pairing.branches import missing
from screwgauge.diagnosis.pairing.common import STANDARD, brought, weighed
from screwgauge.diagnosis.pairing.mapping import paired
from screwgauge.diagnosis.transformations import held, placed
from screwgauge.models.kinematics import not_modelled
from screwgauge.models.matter import Matter
from screwgauge.witness.constraints import admissible_projector, closed
from screwgauge.witness.dynamics import armature_force, dynamics, inverse_dynamics, passive_force
