"""The command line, and the files that it reads and writes."""

from __future__ import annotations

from screwgauge.cli import main
from screwgauge.reference.files import LIMITS, beside, digest, read_file, read_json, replace_file
