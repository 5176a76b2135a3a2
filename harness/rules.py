"""Rules that fix the forces of redundant actuators, and what is said where one of them has no solution."""

from __future__ import annotations

import numpy as np

from screwgauge.reference.linear import SINGULAR
from screwgauge.reference.rotations import Array


def singular_note(rule: str, t: Array, condition: Array) -> tuple[str, ...]:
    """A sentence for the report if the rule is singular somewhere.

    Args:
        t: Times [s]. Shape (n,).
        condition: Condition number of the rule's equations, empty where the rule has none. Shape (n,) or (0,).
    """
    bad = np.flatnonzero(~(condition <= SINGULAR))
    if not bad.size:
        return ()
    times = ", ".join(f"{t[i]:.6g}" for i in bad[:5]) + (", ..." if bad.size > 5 else "")
    return (
        f"rule {rule} is singular at {bad.size} of {len(t)} samples (t = {times} s; condition above {SINGULAR:.0e}): "
        "forces are not given there",
    )
