"""Two models paired part by part, each in the terms of the other, and their torques."""

from __future__ import annotations

from screwgauge.diagnosis.mechanics.closed import closed, left
from screwgauge.diagnosis.mechanics.dynamics import (
    armature_force,
    dynamics,
    inverse_dynamics,
    not_modelled,
    passive_force,
)
from screwgauge.diagnosis.mechanics.matter import Matter
from screwgauge.diagnosis.mechanics.reshape import held, placed
from screwgauge.diagnosis.pairing.branches import missing
from screwgauge.diagnosis.pairing.common import STANDARD, brought, weighed
from screwgauge.diagnosis.pairing.mapping import paired
