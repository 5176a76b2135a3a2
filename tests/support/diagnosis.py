"""The diagnosis of two model files, from pairs of bodies to patches."""

from __future__ import annotations

from screwgauge.diagnosis.asked import answers, pairs
from screwgauge.diagnosis.causes.attribution import Largest, Torques, attribute
from screwgauge.diagnosis.causes.backfill import backfill, write_fix
from screwgauge.diagnosis.causes.conventions import com_slips, gravity_slips, placement_slips, tensor_slips, unit_slip
from screwgauge.diagnosis.causes.fitting import fitted
from screwgauge.diagnosis.causes.growth import SPEEDS, growth
from screwgauge.diagnosis.causes.hypothesis import Hypothesis
from screwgauge.diagnosis.compare import STATES
from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.differences.change import Change, applied, without
from screwgauge.diagnosis.differences.digits import ALL, digits_of, marked
from screwgauge.diagnosis.differences.static import differences
from screwgauge.diagnosis.differences.words import vector
from screwgauge.diagnosis.files.patch import patched
from screwgauge.diagnosis.files.xml_text import XmlText
from screwgauge.diagnosis.mechanics.closed import closed, left
from screwgauge.diagnosis.mechanics.dynamics import (
    armature_force,
    deflection,
    downwards,
    dynamics,
    inverse_dynamics,
    not_modelled,
    passive_force,
    rotor_acceleration,
)
from screwgauge.diagnosis.mechanics.matter import Matter
from screwgauge.diagnosis.mechanics.reshape import held, placed
from screwgauge.diagnosis.model import Model, in_process
from screwgauge.diagnosis.pairing.branches import missing
from screwgauge.diagnosis.pairing.common import STANDARD, brought, weighed
from screwgauge.diagnosis.pairing.mapping import paired
from screwgauge.diagnosis.record import summary
