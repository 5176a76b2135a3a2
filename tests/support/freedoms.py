"""Freedoms and constraints of a mechanism, and their screws."""

import numpy as np

from screwgauge.reference.graph import Layout, serial_chains
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.mobility import Mobility, check_independent, mobility
from screwgauge.reference.reciprocal import reciprocal_screws
from screwgauge.reference.rotations import Array
from support.solve import at_home, chain_screws


def mobility_at_home(mechanism: Mechanism) -> Mobility:
    return mobility(*at_home(mechanism))


def exchange(screw: Array) -> Array:
    """The operator of eq. (8): swaps the two halves of a screw along its first axis. Shape (6, ...)."""
    return np.concatenate([screw[3:], screw[:3]])


def chain_constraints(lay: Layout, q: Array) -> list[Array]:
    """Wrenches by which each serial chain constrains the output body, eqs. (9)-(11). Shape (6, r) each."""
    return [reciprocal_screws(chain_screws(lay, q, chain)[0]) for chain in serial_chains(lay.mechanism)]


def output_constraints(lay: Layout, q: Array) -> Array:
    return np.concatenate(chain_constraints(lay, q), axis=1)


def output_freedoms(lay: Layout, q: Array) -> Array:
    """Twists that all chains allow the output body, eqs. (13)-(14), orthonormal. Shape (6, freedoms)."""
    return reciprocal_screws(output_constraints(lay, q))
