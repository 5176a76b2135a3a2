"""Mechanisms as tests describe them: built-in ones, descriptions as text, drawn ones, and what they are made of."""

from screwgauge.families.draw import families
from screwgauge.models.catalog import (
    FOLDER,
    four_bars,
    load_mechanism,
    mechanism_names,
    mechanism_path,
    mechanism_tables,
)
from screwgauge.models.home import at_closed_home
from screwgauge.reference.content import same_content
from screwgauge.reference.couplings import Coupling, PolynomialSum
from screwgauge.reference.description import read_tables
from screwgauge.reference.graph import serial_chains, spanning_tree
from screwgauge.reference.lint import Solid, all_too_wide, implausible, of_bodies, suspicious, too_wide
from screwgauge.reference.mechanism import GROUND, KINDS, Body, Frame, Joint, Mechanism, actuator_names

#: The smallest of all: a body that turns about a fixed axis.
ROD = (
    'name = "rod"\nindependent = { x = "h" }\nbodies.rod = { mass = 1, inertia = {} }\n'
    'joints.h = { kind = "R", parent = "ground", child = "rod", axes = [[1, 0, 0]], actuated = true }\n'
)
