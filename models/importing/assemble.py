"""A home in which all loops of a reading are closed, within the limits and well conditioned."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from screwgauge.models.importing.homes import CLOSED, OWN, Home, Loops, chosen, limits, some
from screwgauge.models.kinematics import plant, rehomed
from screwgauge.models.readings.reading import Reading

#: Limits of a joint that has none.
FREE = (-float("inf"), float("inf"))


def assemble(
    reading: Reading, where: str, keyframes: Mapping[str, Mapping[str, float]]
) -> tuple[Reading, tuple[str, ...]]:
    """Finds a closed home near that of the file, within limits and well conditioned if there is one.

    Args:
        keyframes: See `homes.chosen`.

    Returns:
        The reading with that home, and what was moved and why, a sentence each.

    Raises:
        ClosureError: Some loops do not close from any start.
    """
    loops = Loops(plant(reading))
    home, why = chosen(loops, keyframes, where)
    free = {name: replace(reading.joints[name], limits=FREE) for name in home.beyond}
    reading = replace(reading, joints={**reading.joints, **free})
    there = {name: home.q[place] for name, place in loops.tree.places.items() if (home.q != loops.home)[place].any()}
    return rehomed(reading, there)[0], _said(loops, home, why)


def _said(loops: Loops, chosen: Home, why: tuple[str, ...]) -> tuple[str, ...]:
    home = loops.values(loops.home)
    moved = {name: value - home[name] for name, value in loops.values(chosen.q).items() if value != home[name]}
    said, opened = [], loops.gaps(loops.home, CLOSED)
    if moved:
        most = max(moved, key=lambda name: abs(moved[name]))
        near = " nearest to that of the file" if chosen.start == OWN else ""
        aim = f"closed loops{near}" if opened else "room to the limits"
        what = f"{len(moved)} coordinates are moved, '{most}' most, by {moved[most]:.3g}"
        said.append(f"Home is a pose with {aim}: {what}.")
    said += why
    if opened:
        said.append(f"At the file's own home loops are open: {some(opened)}.")
    if chosen.error > CLOSED:
        rounding = some(loops.gaps(chosen.q, CLOSED))
        said.append(f"By the rounding of the file loops close nearly only; frames are moved to close them: {rounding}.")
    if tight := [f"'{name}'" for name, (low, high) in limits(loops) if not low < high]:
        said.append(f"Limits of {some(tight)} leave no room, and are left out.")
    if chosen.beyond:
        said.append(f"Loops or couplings keep {some(chosen.beyond)} beyond limits, which are left out.")
    return tuple(said)
