"""Why two model files differ, and what puts one of them right."""

from __future__ import annotations

from screwgauge.diagnosis.causes.attribution import Largest, Torques, attribute
from screwgauge.diagnosis.causes.backfill import backfill, write_fix
from screwgauge.diagnosis.causes.edits import Group
from screwgauge.diagnosis.differences.words import vector
from screwgauge.diagnosis.patch import patched
from screwgauge.diagnosis.slips import Pair, com_slips, gravity_slips, mass_slips, placement_slips, tensor_slips
from screwgauge.models.files.xml import XmlText
