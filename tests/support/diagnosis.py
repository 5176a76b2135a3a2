"""The diagnosis of two model files: deadline, dynamics of libraries, changes, and its record."""

from __future__ import annotations

from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.findings import summary
from screwgauge.diagnosis.libraries import answers, pairs
from screwgauge.diagnosis.model import in_process
from screwgauge.diagnosis.properties import Change, applied
from screwgauge.diagnosis.shares import STATES
