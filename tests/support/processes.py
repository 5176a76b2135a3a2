"""How processes are started."""

from screwgauge.processes import inherit_safely, python, safe_path
