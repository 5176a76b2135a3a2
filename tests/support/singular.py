"""Motions over singular poses."""

import numpy as np

from screwgauge.study.bench.singular import (
    REFUSED,
    Passing,
    near_change_points,
    textbook_linkages,
)
from screwgauge.study.linkages import Tables, describe, five_bar, four_bar, pin, slider_crank

#: A 3-RPR whose legs are as long as `CUSP` has three assemblies that coincide: around such lengths one assembly becomes
#: another without a singular pose on the way. Base and platform of McAree and Daniel's size, in m.
BASE = np.array([[0.0, 0.0], [1.591, 0.0], [0.0, 1.0]])
PLATFORM = np.array([[0.0, 0.0], [1.704, 0.0], [1.323637323943662, 1.609670846683651]])
CUSP, AROUND = np.array([1.498, 1.38514601, 0.62601004]), 0.1
#: Two of the assemblies with the third leg longer by `AROUND`: position of the platform [m] and its angle [rad].
SHEETS = (-1.3947357802034785, 0.5465492689786025, -0.349340888883658), (-1.45724445692, -0.34704840102, 0.21902095767)


def three_rpr(x: float, y: float, angle: float) -> Tables:
    """Return a 3-RPR at a pose."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    pins, bars = Tables(), dict[str, float]()
    for i, (foot, head) in enumerate(zip(BASE.tolist(), PLATFORM.tolist(), strict=True), 1):
        way = np.array([x, y]) + turn @ head - foot
        lean = float(np.arctan2(way[1], way[0]))
        bars |= {f"lower{i}": 0.2, f"upper{i}": -0.2}
        length, leg = float(np.hypot(*way)), (f"lower{i}", f"upper{i}", (0.0, 0.0), (0.0, 0.0))
        pins[f"r{i}"] = pin("ground", f"lower{i}", tuple(foot), (0.0, 0.0), lean)
        pins[f"p{i}"] = pin(*leg, length, driven=True, slides=True)
        pins[f"w{i}"] = pin(f"upper{i}", "platform", (0.0, 0.0), tuple(head), angle - lean)
    return describe({**bars, "platform": 0.9}, pins, "p1", "p2", "p3")
