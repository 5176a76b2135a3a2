"""Units that people mix up: SI unit -> factor of the number in the other unit -> that unit."""

from __future__ import annotations

import math

_INCH, _POUND = 0.0254, 0.45359237
ANGLE = {180.0 / math.pi: "degrees"}
UNITS: dict[str, dict[float, str]] = {
    "kg": {1e3: "g", 1.0 / _POUND: "lb"},
    "m": {1e3: "mm", 1e2: "cm", 1.0 / _INCH: "inches"},
    "kg m^2": {
        1e9: "g mm^2",
        1e6: "kg mm^2",
        1e7: "g cm^2",
        1e4: "kg cm^2",
        1e3: "g m^2",
        1.0 / (_POUND * _INCH**2): "lb in^2",
    },
    "rad": ANGLE,
    "N m s/rad": {math.pi / 180.0: "N m s/deg"},
    "N m/rad": {math.pi / 180.0: "N m/deg", 1e3: "N mm/rad"},
    "N m": {1e3: "N mm"},
    "m/s^2": {1e3: "mm/s^2", 1.0 / 9.81: "g"},
}
