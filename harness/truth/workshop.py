"""Samples at one precision, and with more bits where that does not do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

from flint import arb, ctx

from screwgauge.problem import GivenMotion, Problem
from screwgauge.truth.certify import NotCertified
from screwgauge.truth.motion import Terms, drive, read_terms, samples
from screwgauge.truth.samples import Sampler

#: A sample with a wider ball than this share of its quantity is enclosed anew with more bits: near singular poses and
#: gimbal lock accelerations are small differences of terms that grow as 1 / distance^2.
WIDE = 1e-25


class Workshop:
    """All that depends on the precision, made when it is first needed."""

    def __init__(self, sampler: Callable[[], Sampler], problem: Problem, motion: GivenMotion, bits: int) -> None:
        self.make, self.problem, self.motion, self.bits = sampler, problem, motion, bits

    @cached_property
    def sampler(self) -> Sampler:
        return self.make()

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


def centred(wide: Workshop, exact: Workshop, row: int, start: Sequence[float]) -> dict[str, list[arb]]:
    """A sample that `wide` encloses, in balls around what the exact text gives, whose redundant rows were left out.

    Ball arithmetic wraps: where numbers are wide from the start, what it encloses lies anywhere in its balls.

    Raises:
        NotCertified: Something could not be enclosed.
    """
    enclosures, values = wide.sample(row, start), exact.sample(row, start)
    with ctx.workprec(wide.bits):
        return {
            name: [arb(b.mid(), (a - b.mid()).abs_upper()) for a, b in zip(balls, values[name], strict=True)]
            for name, balls in enclosures.items()
        }


def _narrow(balls: Sequence[arb]) -> bool:
    largest = max((float(ball.abs_upper()) for ball in balls), default=0.0)
    return all(float(ball.rad()) <= WIDE * largest for ball in balls)
