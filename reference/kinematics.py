"""Positions of all joints (section 3 of the paper), on the assembly mode of the home pose."""

from __future__ import annotations

from collections.abc import Collection

from screwgauge.reference.closed.assembly_mode import AssemblyMode, Rates
from screwgauge.reference.closed.loops import read
from screwgauge.reference.equations import closed_form as forms
from screwgauge.reference.equations.ops import NUMPY
from screwgauge.reference.graph import Layout
from screwgauge.reference.rotations import Array


def positions(lay: Layout, y: Array, t: Array, rates: Rates | None = None) -> Array:
    """Joint coordinates on the assembly mode of home, see `AssemblyMode.motion`.

    Args:
        y: Independent coordinates [rad or m]. Shape (n, k).
        t: Times [s]. Shape (n,).
        rates: Derivatives, by which the motion is followed between samples. Shape (n, k) each.

    Returns:
        Of all joints [rad or m]. Shape (n, n_q).

    Raises:
        ClosureError: A loop cannot close, or there is no way but over a singular pose.
    """
    return AssemblyMode(lay).motion(y, t, rates)


def closed_form(lay: Layout, y: Array, fixed: Collection[int] | None = None) -> Array | None:
    """Joint coordinates in closed form, if there is one, see `equations.closed_form`. Shape (n, k) -> (n, n_q)."""
    found = forms.closed_form(lay, y, NUMPY, fixed)
    return None if found is None else read(lay, found.q, near=False)
