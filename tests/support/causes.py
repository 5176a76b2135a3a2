"""Corrections of model files."""

from __future__ import annotations

from screwgauge.diagnosis.fix import write_fix
from screwgauge.diagnosis.patch import change_file
from screwgauge.models.files.xml import XmlText
