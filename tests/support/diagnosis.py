"""The diagnosis of two model files: deadline, dynamics of libraries, changes, and its record."""

from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.findings import summary
from screwgauge.diagnosis.libraries import ask_library, compare_tree
from screwgauge.diagnosis.model import read_here
from screwgauge.diagnosis.properties import Change, apply_changes
from screwgauge.diagnosis.shares import STATES
