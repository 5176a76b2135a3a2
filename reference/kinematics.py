"""Joint coordinates of closed poses for given motions."""

from __future__ import annotations

from collections.abc import Collection

from screwgauge.reference.closed.continuation import OPEN, newton
from screwgauge.reference.closed.cut_coordinates import read
from screwgauge.reference.closed.following import Follower
from screwgauge.reference.closed.loops import Rates
from screwgauge.reference.closed.resting import home_equations
from screwgauge.reference.equations import closed_form as forms
from screwgauge.reference.equations.ops import NUMPY
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.layout import Layout
from screwgauge.reference.rotations import Array


def positions(lay: Layout, y: Array, t: Array, rates: Rates | None = None, *, path: Follower | None = None) -> Array:
    """Joint coordinates of poses on the branch of home: in closed form where that is this branch, else followed.

    Args:
        y: Independent coordinates [rad or m]. Shape (n, k).
        t: Times [s]. Shape (n,).
        rates: Derivatives, by which the motion is followed where the straight way between samples is singular.
        path: What has followed the samples before these, such as `home_equations(lay).follower()`; home by default.

    Returns:
        Of all joints [rad or m]. Shape (n, n_q).

    Raises:
        ClosureError: A loop cannot close, or there is no way but over a singular pose.
    """
    system = home_equations(lay)
    start = closed_form(lay, y, system.fixed)
    if start is None:
        return system.follow(path or system.follower(), y, t, rates).q
    z, _, error = newton(
        system.evaluate, (start / system.size)[:, system.unknown], y / system.size[lay.mechanism.independent_columns]
    )
    if not (error < OPEN).all():
        raise ClosureError("the closed form leaves loops open", lay.mechanism.name, "check the geometry")
    return system.coordinates(z, start)


def closed_form(lay: Layout, y: Array, fixed: Collection[int] | None = None) -> Array | None:
    """Joint coordinates in closed form, if there is one, see `equations.closed_form`. Shape (n, k) -> (n, n_q)."""
    found = forms.closed_form(lay, y, NUMPY, fixed)
    return None if found is None else read(lay, found.q, near=False)
