"""Whether the energy of a motion balances: kinetic, of gravity, of springs, and the work put in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from screwgauge.judging.answer import Answer, Row, largest
from screwgauge.judging.integration import MOST, SAFETY
from screwgauge.quantities import FLOOR
from screwgauge.reference.rotations import Array
from screwgauge.witness.dynamics import kinetic_energy
from screwgauge.witness.wrenches import spring_energy


def energy_balance(answer: Answer, looser: Sequence[Answer] = ()) -> Iterator[Row]:
    """Energy gained since the first sample less the work done since [J], if that work is known.

    It is measured by the largest of its parts: kinetic, gravity, springs, work.

    Args:
        looser: The same motion integrated with looser tolerances: what of the balance that changes is integration.
    """
    if (found := _balance(answer)) is None:
        return
    missing, size = found
    others = [other[0] for one in looser if (other := _balance(one)) is not None]
    reason = ""
    if others:
        apart = largest(*(a - b for a, b in combinations([missing, *others], 2)))
        left = min(SAFETY * apart / max(size, FLOOR * answer.scales["J"]), MOST)
        answer = replace(answer, tolerance=answer.tolerance + left)
        reason = f"integration leaves at most {left:.1g}"
    row = answer.residual("energy_balance", "J", ["energy"], missing, size, ())
    yield {**row, "reason": row["reason"] or reason}


def _balance(answer: Answer) -> tuple[Array, float] | None:
    """What is missing in the balance of energy at each sample, shape (n, 1), and the largest of its parts [J]."""
    applied, work = answer.applied, answer.work
    if not (applied.motors or applied.loads or any(spring.damping for spring in applied.springs)):
        work = np.zeros(len(answer.t))
    if not answer.has("joint_velocity") or work is None or np.isnan(work).all():
        return None
    work = work - work[0]  # the first sample may come after the start
    kinetic, *stored = energies(answer)
    gained = [part - part[0] for part in (kinetic, *stored)]
    missing = (sum(gained) - work)[:, None]
    return np.asarray(missing), largest(kinetic, *gained, work)


def energies(answer: Answer) -> tuple[Array, Array, Array]:
    """Kinetic, of gravity, of springs [J]. Shape (n,) each."""
    gravity = -(answer.motion.com.p @ answer.applied.g) @ answer.tree.matter.mass
    springs = spring_energy(answer.tree, answer.motion, answer.q, answer.applied)
    return kinetic_energy(answer.motion), gravity, springs
