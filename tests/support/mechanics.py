"""Dynamics of a reading, and what loops admit."""

from screwgauge.diagnosis.facts.fact import STANDARD
from screwgauge.diagnosis.shares import with_gravity
from screwgauge.models.kinematics import unmodelled_forces
from screwgauge.witness.constraints import admissible_projector, close_loops
from screwgauge.witness.dynamics import armature_force, dynamics, inverse_dynamics, passive_force
