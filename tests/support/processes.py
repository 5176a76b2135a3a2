"""How processes are started."""

from __future__ import annotations

from screwgauge.processes import inherit_safely, python, safe_path
