"""Corrections of model files."""

from screwgauge.diagnosis.fix import write_fix
from screwgauge.diagnosis.patch import change_file
from screwgauge.models.files.xml import XmlText
