"""All that a diagnosis finds, as data: facts, causes, reasons, and what was compared besides. `words` makes English."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from screwgauge.diagnosis.causes.causes import Cause
from screwgauge.diagnosis.causes.reasons import Reason
from screwgauge.diagnosis.facts.content import Beyond
from screwgauge.diagnosis.facts.fact import IDLE, Fact, Pair
from screwgauge.diagnosis.fix import Fix
from screwgauge.diagnosis.libraries import LibraryCheck, Together
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.order import Order
from screwgauge.diagnosis.shares import SAME, Largest


@dataclass(frozen=True, slots=True, eq=False)
class Findings:
    """What two models differ in, or that they do not.

    Attributes:
        pair: The two machines with partners; `how`: joint of A -> ``given``, ``name``, ``similar name``, ``geometry``
            or ``geometry, against its name``.
        alike: Whether enough has a partner for the two to be compared.
        facts: Of bodies, joints, loops and content; a whole first.
        standing: Facts of B as it stands, where one of the whole is told in their place.
        causes: Of the facts, ranked; `reasons`: what somebody may have done.
        torques: What all facts make of the torques of A; `by_joint`: the same for each component, scaled.
        mobility: Freedoms that loops leave in A and in B; None where neither has any.
        agreement: Dynamics of both readings compared, where nothing else differs; `together`: those of the libraries as
            loaded, or None and `why_not`.
        left_out: What there was no time for in `limit` seconds.
        only: What was asked to be compared alone; empty for all.
    """

    a: Model
    b: Model
    seed: int
    pair: Pair
    how: Mapping[str, str]
    alike: bool
    facts: tuple[Fact, ...] = ()
    standing: tuple[Fact, ...] = ()
    causes: tuple[Cause, ...] = ()
    reasons: tuple[Reason, ...] = ()
    beyond: Beyond = field(default_factory=Beyond)
    torques: Largest = field(default_factory=lambda: Largest(0.0, 0.0, "", ""))
    by_joint: tuple[tuple[str, float], ...] = ()
    mobility: tuple[int, int] | None = None
    agreement: Largest | None = None
    together: Together | None = None
    why_not: str = ""
    witnesses: tuple[LibraryCheck, ...] = ()
    order: Order | None = None
    fix: Fix | None = None
    left_out: tuple[str, ...] = ()
    limit: float = 0.0
    only: str = ""

    @property
    def open_facts(self) -> tuple[Fact, ...]:
        """Facts that no value in B's file mends."""
        open_ = {(fact.what, fact.partner or fact.part) for fact in self.fix.open} if self.fix else set()
        return tuple(f for f in self.facts if {(f.what, f.part), (f.what, f.partner)} & open_)

    @property
    def agrees(self) -> bool:
        """Whether nothing that was compared differs."""
        real = [fact for fact in self.facts if fact.what not in IDLE]
        closed = not (self.a.never_closed or self.b.never_closed) and self.mobility_agrees
        dynamics = (self.agreement is None or self.agreement.scaled <= SAME) and (
            self.together is None or self.together.agrees
        )
        return self.alike and not real and closed and dynamics and all(each.agrees for each in self.witnesses)

    @property
    def mobility_agrees(self) -> bool:
        return self.mobility is None or self.mobility[0] == self.mobility[1]

    @property
    def undecided(self) -> bool:
        """Nothing differs, and what is not compared withholds that the two are the same."""
        return self.agrees and bool(self.beyond.withheld or self.why_not)

    @property
    def same(self) -> bool:
        return self.agrees and not self.undecided and not self.left_out
