"""Freedoms and constraints of a mechanism, and their screws."""

from __future__ import annotations

from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.mobility import (
    Mobility,
    chain_constraints,
    check_independent,
    exchange,
    in_lengths,
    mobility,
    output_constraints,
    output_freedoms,
    reciprocal_screws,
)
from support.solve import at_home


def mobility_at_home(mechanism: Mechanism) -> Mobility:
    """Its freedoms and constraints, counted at home."""
    return mobility(*at_home(mechanism))
