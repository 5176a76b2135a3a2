"""Findings of a diagnosis, as data and as ``diagnosis.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from screwgauge.diagnosis.causes.causes import Cause
from screwgauge.diagnosis.causes.reasons import Reason
from screwgauge.diagnosis.facts.fact import IDLE, Fact
from screwgauge.diagnosis.facts.structure import Sided
from screwgauge.diagnosis.fix import Fix
from screwgauge.diagnosis.libraries import LibraryCheck, Together
from screwgauge.diagnosis.machine.pair import Pair
from screwgauge.diagnosis.machine.whole import Whole
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.shares import SAME, Largest, Order

if TYPE_CHECKING:
    from screwgauge.diagnosis.answer import Diagnosis, Difference


@dataclass(frozen=True, slots=True, eq=False)
class Findings:
    """Results of comparing two models, as data.

    Attributes:
        pair: The two machines and their matching.
        how: Joint of A -> ``given``, ``name``, ``similar name``, ``geometry`` or ``geometry, against its name``.
        alike: True if enough parts have a partner for a comparison.
        facts: Differences in bodies, joints, loops and content; a difference in the whole machine comes first.
        standing: Facts about B as it is, if a fact about the whole machine replaces them.
        causes: Ranked causes of the facts; `reasons`: likely slips behind them.
        withheld: Content that could differ but is not compared, with its model; `aside`: content that is out of scope.
        torques: Largest effect of all facts on the torques of A; `by_joint`: scaled effect on each component.
        mobility: Degrees of freedom of A and of B with closed loops; None without loops.
        agreement: Difference between the dynamics of the two readings, if nothing else differs.
        together: Difference in the dynamics that libraries compute from the loaded files; if None, see `why_not`.
        left_out: Work that was skipped because the time limit of `limit` seconds was reached.
        only: The only group of properties that was compared; empty for all.
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
    withheld: Sided = ()
    aside: Sided = ()
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
        """Facts that no change of a value in B's file corrects."""
        open_ = {(fact.what, fact.partner or fact.part) for fact in self.fix.open} if self.fix else set()
        return tuple(f for f in self.facts if {(f.what, f.part), (f.what, f.partner)} & open_)

    @property
    def agrees(self) -> bool:
        """True if no compared property differs."""
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
        """True if nothing differs, but something that is not compared might."""
        return self.agrees and bool(self.withheld or self.why_not)

    @property
    def same(self) -> bool:
        return self.agrees and not self.undecided and not self.left_out


SCHEMA = 3
#: Quantity in which the shares of causes are measured.
SCALE = (
    "projection onto the torque difference at random states; each torque is divided by the largest torque in its unit"
)


def summary(diagnosis: Diagnosis) -> dict[str, Any]:
    """Build the content of ``diagnosis.json``; each cause lists its differences as indices into `differences`."""
    found = diagnosis.found
    return {
        "schema": SCHEMA,
        "date": diagnosis.date,
        "headline": diagnosis.headline,
        "verdict": diagnosis.verdict,
        "same": diagnosis.same,
        "not_all_compared": diagnosis.undecided,
        "not_compared": diagnosis.not_compared,
        "only": found.only,
        "seed": found.seed,
        "models": {side: _model(model) for side, model in (("A", found.a), ("B", found.b))},
        **_partners(found),
        "differences": [_difference(each) for each in diagnosis.differences],
        "facts": [_fact(each) for each in found.standing],
        "causes": [asdict(cause) for cause in diagnosis.causes],
        "torques": {**asdict(found.torques), "scale": SCALE},
        "torque_by_joint": [{"component": name, "change": change} for name, change in found.by_joint],
        "mobility": found.mobility and dict(zip("AB", found.mobility, strict=True)),
        "agreement": found.agreement and asdict(found.agreement),
        "order": found.order and asdict(found.order),
        "fix": found.fix
        and {"proved": found.fix.proved, "unheard": found.fix.unheard, "not_fixed": diagnosis.not_fixed},
        "libraries_together": found.together and asdict(found.together),
        "libraries": [asdict(witness) for witness in found.witnesses],
        "notes": diagnosis.notes,
        "doubts": diagnosis.doubts,
        "left_out": found.left_out,
    }


def _model(model: Model) -> dict[str, Any]:
    return {
        "file": model.label,
        "library": model.library,
        "sha256": model.sha256,
        "loops": model.loops and {"file": str(model.loops), "sha256": model.loops_sha256},
        "digits": model.digits,
        "joints": len(model.reading.joints),
        "bodies": len(model.reading.bodies),
        "mass": model.reading.mass,
        "ignored": model.reading.ignored,
    }


def _partners(found: Findings) -> Mapping[str, Any]:
    """List partners, and parts without a partner."""
    pair, alone = found.pair, (found.pair.only_a, found.pair.only_b)
    joints = {name: pair.partner(name).name for name in found.how}
    missing = {
        key: ["/".join(link.names) for link in links] for key, links in zip(("in_b", "in_a"), alone, strict=True)
    }
    return {"map": {"joints": joints, "how": found.how, "bodies": pair.bodies}, "missing": missing}


def _difference(each: Difference) -> dict[str, Any]:
    return {key: _value(getattr(each, key)) for key in each.__slots__}


def _fact(each: Fact) -> dict[str, Any]:
    keys = ("part", "partner", "what", "of", "more", "a", "b", "unit", "size", "kind")
    return {key: _value(getattr(each, key)) for key in keys}


def _value(value: Any) -> Any:
    return asdict(value) if isinstance(value, Whole) else value
