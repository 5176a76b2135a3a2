"""Samples at one precision, and with more bits where that does not do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

from flint import arb, ctx

from screwgauge.problem import GivenMotion, Problem
from screwgauge.solution import Clock
from screwgauge.truth.certify import NotCertified
from screwgauge.truth.linkage import Linkage
from screwgauge.truth.motion import Terms, drive, read_terms, samples
from screwgauge.truth.samples import Sampler

#: A sample with a wider ball than this share of its quantity is enclosed anew with more bits: near singular poses and
#: gimbal lock accelerations are small differences of terms that grow as 1 / distance^2.
WIDE = 1e-25


class Workshop:
    """All that depends on the precision, made when it is first needed."""

    def __init__(
        self,
        linkage: Callable[[], Linkage],
        problem: Problem,
        motion: GivenMotion,
        depth: str,
        clock: Clock,
        bits: int,
    ) -> None:
        self.linkage, self.problem, self.motion = linkage, problem, motion
        self.depth, self.clock, self.bits = depth, clock, bits

    @cached_property
    def sampler(self) -> Sampler:
        return Sampler(self.linkage(), self.problem, self.depth, self.clock)

    @cached_property
    def terms(self) -> Terms | None:
        said = self.problem.wording.motion
        return None if said is None else read_terms(said, list(self.sampler.linkage.mechanism.independent))

    def sample(self, row: int, start: Sequence[float]) -> dict[str, list[arb]]:
        """All quantities of one sample of the motion.

        Args:
            start: An unverified guess of the joint coordinates.

        Raises:
            NotCertified: Something could not be enclosed.
        """
        motion = self.motion
        with ctx.workprec(self.bits):
            terms = self.terms
            y = samples(motion, row) if terms is None else drive(terms, float(motion.t[row]))
            return self.sampler.sample(y, start)


def enclosed(workshops: Sequence[Workshop], row: int, start: Sequence[float]) -> dict[str, list[arb]]:
    """A sample in narrow balls: of the first workshop that makes them, else those of the last.

    Raises:
        NotCertified: None of them had bits enough.
    """
    for workshop in workshops[:-1]:
        try:
            quantities = workshop.sample(row, start)
        except NotCertified:
            continue
        if all(_narrow(balls) for balls in quantities.values()):
            return quantities
    return workshops[-1].sample(row, start)


def _narrow(balls: Sequence[arb]) -> bool:
    largest = max((float(ball.abs_upper()) for ball in balls), default=0.0)
    return all(float(ball.rad()) <= WIDE * largest for ball in balls)
