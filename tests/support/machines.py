"""Machines as bodies and links, aligned to each other and cut alike."""

from __future__ import annotations

from screwgauge.diagnosis.machine.alignment import aligned
from screwgauge.diagnosis.machine.placement import misfits
from screwgauge.diagnosis.model import loaded
from screwgauge.models.machine import machine_of
