"""Machines as bodies and links, aligned to each other and cut alike."""

from screwgauge.diagnosis.machine.alignment import align, assign
from screwgauge.diagnosis.machine.features import misfits as misfits
from screwgauge.diagnosis.machine.placement import Believed
from screwgauge.diagnosis.machine.placement import coordinate_placement as coordinate_placement
from screwgauge.diagnosis.model import load_side
from screwgauge.models.kinematics import draw, rehome, tree_of
from screwgauge.models.machine import machine_of
from screwgauge.witness.constraints import close_loops
