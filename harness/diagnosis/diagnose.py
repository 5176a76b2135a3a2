"""Why two models of a machine differ: the way from two files to one sentence and its proof; and as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.diagnosis.causes.attribution import Attribution, Cause
from screwgauge.diagnosis.causes.backfill import Backfill, write_fix
from screwgauge.diagnosis.causes.edits import WHOLE
from screwgauge.diagnosis.causes.explanation import explained
from screwgauge.diagnosis.compare import STATES, Order, Row, order_of, table, torques
from screwgauge.diagnosis.deadline import LIMIT, Deadline
from screwgauge.diagnosis.differences.content import beyond
from screwgauge.diagnosis.differences.difference import Difference, marked
from screwgauge.diagnosis.differences.loops import COUNTED, Loops, at_home, cut_joints, loops
from screwgauge.diagnosis.differences.static import differences, distinct
from screwgauge.diagnosis.library_dynamics import LibraryCheck, library_checks
from screwgauge.diagnosis.model import Loops as Beside
from screwgauge.diagnosis.model import Model, Read, Weighed, alike, cut_alike, each_loops, in_process, loaded
from screwgauge.diagnosis.notes import compiled, notes, outside
from screwgauge.diagnosis.pairing.branches import bare, missing
from screwgauge.diagnosis.pairing.common import brought
from screwgauge.diagnosis.pairing.mapping import Pairing, read_map
from screwgauge.diagnosis.pairing.views import View, views
from screwgauge.diagnosis.properties import applied
from screwgauge.diagnosis.together import ELSEWHERE, Together, elsewhere, together
from screwgauge.diagnosis.verdict import BINDING, RESTATED, SAME, partly, stopped, strange, verdict
from screwgauge.models.formats import WIDE
from screwgauge.models.kinematics import draw
from screwgauge.models.readings.read import implausible
from screwgauge.reference.errors import DescriptionError, OutputError, check_seed, shown


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """Why two models differ, or that they do not.

    Attributes:
        headline: What differs, or that nothing does, in one sentence of at most `verdict.WORDS` words.
        explanation: Further sentences: the share that causes explain, the rest, and what else matters.
        same: Whether nothing differs.
        pairing: Of joints and bodies; `differences`: static ones, from the ground outwards.
        rows: Differences at `seed`'s random states by quantity; none between different machines.
        loops: What closures and couplings leave; None where they are not compared.
        attribution: Of the torque difference; `proof`: by backfill. None where the torques agree.
        fix: B's file with all changes that it can hold, also those without effect on torques; None if there are none.
        witnesses: Each library's own torques, compared with the dynamics of its reading.
        notes: What was taken for granted, or not compared.
        left_out: What there was no time for.
        order: In which the two libraries index the joints; None where it is the same, or a description has none.
        by_joint: Component of the torques, and its largest scaled difference before and after all changes in B.
        together: The libraries' own torques of both, as loaded; None where they are not compared.
        not_compared: What is not compared and could differ, a phrase each, with its side.
        causes: The differences by cause, the one with the largest share of the torque difference first.
        date: When it was made, ISO 8601 in UTC.
        undecided: Nothing differs, and what is in `not_compared` withholds that the two are the same.
    """

    a: Model
    b: Model
    seed: int
    headline: str
    explanation: str
    same: bool
    pairing: Pairing
    differences: tuple[Difference, ...]
    rows: tuple[Row, ...] = ()
    loops: Loops | None = None
    attribution: Attribution | None = None
    proof: Backfill | None = None
    fix: Backfill | None = None
    witnesses: tuple[LibraryCheck, ...] = ()
    notes: tuple[str, ...] = ()
    by_joint: tuple[tuple[str, float, float], ...] = ()
    left_out: tuple[str, ...] = ()
    together: Together | None = None
    not_compared: tuple[str, ...] = ()
    undecided: bool = False
    order: Order | None = None
    date: str = ""

    @property
    def causes(self) -> tuple[Cause, ...]:
        return self.attribution.causes if self.attribution else ()

    @property
    def verdict(self) -> str:
        """Headline and explanation."""
        return f"{self.headline} {self.explanation}".strip()

    def __bool__(self) -> bool:
        """`assert diagnosis` passes only if the two are the same."""
        return self.exit_status == 0

    @property
    def exit_status(self) -> int:
        """Exit status: 0 the same, 1 different or not all compared, 3 a library failed or time was over."""
        if self.left_out or any(witness.failed for witness in self.witnesses):
            return 3
        return 0 if self.same else 1

    @property
    def doubts(self) -> tuple[str, ...]:
        """Sentences on numbers of the models that no machine has."""
        a, b = (implausible(model.reading) for model in (self.a, self.b))
        both = [f"A and B: {text}" for text in a if text in b]
        ours, theirs = [f"A: {text}" for text in a if text not in b], [f"B: {text}" for text in b if text not in a]
        return (*both, *ours, *theirs)

    @property
    def not_fixed(self) -> tuple[str, ...]:
        """What the file that `write_fix` writes does not correct, and why."""
        alone = [f"no change of B's file is known for this: {d.sentence}" for d in self.differences if d.change is None]
        return (*(self.fix.why_not if self.fix else ()), *alone)

    def write_fix(self, out: Path) -> Path:
        """Writes B as it would have to be to agree with A.

        Raises:
            OutputError: There is no such file, or it cannot be written.
        """
        if self.fix is None or not self.fix.text or self.b.file is None:
            why = "; ".join(self.not_fixed) or "nothing differs"
            raise OutputError(f"there is nothing to write: {why}", str(out), "leave out --fix")
        write_fix(out, self.fix.text, self.b.file, self.b.own)
        return out


def diagnose(
    a: str | Path | Weighed,
    b: str | Path | Weighed,
    *,
    map: str | Path | Mapping[str, str] | None = None,
    seed: int = 0,
    loops: Beside = None,
    limit: float = LIMIT,
    load: Read = in_process,
) -> Diagnosis:
    """Compares two models; what it takes and raises is described at `screwgauge.api.diagnose`.

    Args:
        a, b: Also `model.weighed` of a file where mass comes from meshes.
    """
    check_seed(seed)
    deadline = Deadline(limit)
    if not isinstance(map, str | Path | Mapping | None):
        raise DescriptionError(f"{shown(map)} is no file and no table of names", "map", "give either")
    given = read_map(Path(map)) if isinstance(map, str | Path) else map
    first, second = each_loops(loops, (a, b))
    sides = at_home(alike(loaded(a, load, first), loaded(b, load, second), load))
    one, two, pairing = cut_alike(*sides, given)
    if not pairing.alike:
        diagnosis = Diagnosis(one, two, seed, *strange((one, two), pairing), False, pairing, ())
    else:
        diagnosis = _of_pair(one, two, pairing, seed, load, deadline)
    for view in views(sides, pairing, given) if worth(diagnosis) and not deadline.left_out else ():
        other = _of_pair(*view.models, view.pairing, seed, load, deadline, view)
        if simpler(other, diagnosis):
            diagnosis = other
    diagnosis = replace(diagnosis, date=datetime.now(UTC).isoformat(timespec="seconds"))
    if not deadline.left_out:
        return diagnosis
    stopped_early = _and(diagnosis, stopped(limit, deadline.left_out))
    return replace(stopped_early, same=False, left_out=tuple(deadline.left_out))


def _of_pair(
    a: Model, b: Model, pairing: Pairing, seed: int, load: Read, deadline: Deadline, view: View | None = None
) -> Diagnosis:
    """Diagnosis of two models of one machine, with the order of their joints and what else is to be said of both."""
    diagnosis = _compared(a, b, pairing, seed, load, deadline, view)
    if order := order_of((a, b), pairing, seed):
        diagnosis = replace(_and(diagnosis, order.sentence), order=order)
    if not pairing.one_machine:
        diagnosis = replace(diagnosis, explanation=f"{partly((a, b), pairing)} {diagnosis.explanation}".strip())
    if elsewhere(a) or elsewhere(b):
        diagnosis = replace(diagnosis, notes=(*diagnosis.notes, ELSEWHERE))
    return diagnosis


def _and(diagnosis: Diagnosis, sentence: str) -> Diagnosis:
    """A diagnosis with another sentence at the end of its explanation."""
    return replace(diagnosis, explanation=f"{diagnosis.explanation} {sentence}".strip())


def _compared(
    a: Model, b: Model, pairing: Pairing, seed: int, load: Read, deadline: Deadline, view: View | None
) -> Diagnosis:
    """Diagnosis of two models of one machine.

    Args:
        view: What the whole may be made by.
    """
    lost = [*missing(a.reading, b.reading, pairing)]
    ours, theirs = bare(a.reading, b.reading, lost)
    # what B has beyond A shows in its torques and can be taken away; without what A has beyond B both are compared
    common = brought(ours, b.reading, pairing)
    both_have = common if theirs is b.reading else brought(ours, theirs, pairing)
    facts, content = [*lost, *differences(both_have, deadline)[0]], beyond(common)
    states = draw(common.a, STATES, seed)
    tau = torques(common, pairing, states)
    rows = [] if deadline.over("motion at random states") else table(common, states)
    counts = [each.change for each in facts if each.kind == "convention" and each.what in COUNTED and each.change]
    counted = brought(ours, applied(b.reading, counts), pairing) if counts else common
    bound, of_loops = loops(counted, pairing, seed, deadline)
    facts += cut_joints((a, b))
    stated = _stated(facts, (a, b), bound)
    restated = bound is not None and bound.alike and any(each.what in BINDING for each in facts)
    facts = [*compiled((a, b), marked(stated, (a.digits, b.digits))), *content.differences]
    paths = [None if model.library == "screwgauge" else model.file for model in (a, b)]
    read = (a.reading, b.reading), (paths[0], paths[1])
    written = b.as_read if b.cut is not None else None
    of_whole = view.group(facts) if view else None
    why = explained(tau, *read, facts, lambda file: b.read_again(file, load), deadline, written, of_whole)
    cause = why.attribution
    seen = tuple(library_checks((a, b), seed, deadline))
    both, why_not = None, ""
    if not lost and cause.before.scaled <= SAME and not deadline.over("torques of the libraries as loaded"):
        both, why_not = together((a, b), common, seed)
    late = bool(deadline.left_out)
    alike = not facts and cause.before.scaled <= SAME and (bound is None or bound.closes_alike)
    alike = alike and not (a.never_closed or b.never_closed)
    alike = alike and all(witness.agrees for witness in seen) and (both is None or both.agrees)
    withheld = (*content.withheld, *([f"torques of the libraries as loaded: {why_not}"] if why_not else []))
    withheld += (of_loops,) if bound is None and of_loops else ()
    return Diagnosis(
        a,
        b,
        seed,
        *verdict((a, b), facts, why, seen, (bound, restated), replace(content, withheld=withheld), both, late=late),
        alike and not withheld,
        pairing,
        tuple(distinct(facts)),
        rows=(*rows, *([bound.row] if bound else [])),
        loops=bound,
        attribution=_numbered(cause, facts),
        proof=why.proof,
        fix=why.fix,
        witnesses=seen,
        notes=(*notes((a, b), common, seen, of_loops, seed, compared=bound is not None), *outside(content)),
        by_joint=cause.by_joint,
        together=both,
        not_compared=withheld,
        undecided=alike and bool(withheld),
    )


def _numbered(attribution: Attribution, facts: Sequence[Difference]) -> Attribution:
    """An attribution whose differences are numbered among the distinct ones."""
    numbers = {each.sentence: i for i, each in enumerate(distinct(facts))}

    def distinctly(some: Sequence[int]) -> tuple[int, ...]:
        return tuple(dict.fromkeys(numbers[facts[i].sentence] for i in some))

    causes = (replace(cause, differences=distinctly(cause.differences)) for cause in attribution.causes)
    return replace(attribution, causes=tuple(causes), seen=distinctly(attribution.seen))


def _stated(facts: Sequence[Difference], models: tuple[Model, Model], bound: Loops | None) -> list[Difference]:
    """Facts without limits that a description, or a model file compared with it, lacks; and without closures that
    one alone has, and places of closures that are made to cut it elsewhere, where these leave the same motions.
    """
    if bound is not None and bound.alike and bound.mobility[0]:
        recut = any(model.cut is not None for model in models)
        facts = [each for each in facts if each.what not in (BINDING if recut else RESTATED)]
    described = "screwgauge" in (model.library for model in models)
    return [each for each in facts if not (described and each.what == "limits" and _of_one_alone(each))]


def _of_one_alone(limits: Difference) -> bool:
    """Whether one of the two models has no limits there: model files are written without those of a description."""
    sides = (np.abs(np.asarray(side, float)) for side in (limits.a, limits.b) if side is not None)
    return any(bool(np.all(side >= WIDE)) for side in sides)


#: What a cause of conventions alone counts beside one that changes the machine.
CONVENTION = 0.2


def worth(diagnosis: Diagnosis) -> bool:
    """Whether another explanation may be simpler: not than one difference, unless a joint sits elsewhere."""
    facts = diagnosis.differences
    return not diagnosis.pairing.alike or len(facts) > 1 or any(each.what == "placement" for each in facts)


def simpler(one: Diagnosis, other: Diagnosis) -> bool:
    """Whether an explanation by the whole has fewer causes, or is the same cause told of the whole."""
    if not other.pairing.alike:
        return True
    few, many = _count(one), _count(other)
    told = len(one.causes) == 1 and one.causes[0].name == WHOLE
    places = len(other.differences) > 1 and {each.what for each in other.differences} == {"placement"}
    return few < many - 1e-9 or (told and places and few == many)


def _count(diagnosis: Diagnosis) -> float:
    """How many causes are to be read; of conventions, which change nothing, less."""
    of = [[diagnosis.differences[i] for i in cause.differences] for cause in diagnosis.causes if cause.kind != "digits"]
    return sum(CONVENTION if all(each.kind == "convention" for each in some) else 1.0 for some in of)


SCHEMA = 2
#: What shares of causes are of.
SCALE = "projection on the torque difference at random states, torques of each unit over the largest of it"


def summary(diagnosis: Diagnosis) -> dict[str, Any]:
    """What ``diagnosis.json`` has."""
    why, proof = diagnosis.attribution, diagnosis.proof
    return {
        "schema": SCHEMA,
        "date": diagnosis.date,
        "headline": diagnosis.headline,
        "verdict": diagnosis.verdict,
        "same": diagnosis.same,
        "not_all_compared": diagnosis.undecided,
        "not_compared": diagnosis.not_compared,
        "seed": diagnosis.seed,
        "models": {side: _facts(model) for side, model in (("A", diagnosis.a), ("B", diagnosis.b))},
        "map": {"joints": diagnosis.pairing.joints, "how": diagnosis.pairing.how, "bodies": diagnosis.pairing.bodies},
        "missing": {"in_b": diagnosis.pairing.only_a, "in_a": diagnosis.pairing.only_b},
        "differences": [_difference(each) for each in diagnosis.differences],
        "causes": [_cause(cause) for cause in diagnosis.causes],
        "dynamics": [asdict(row) for row in diagnosis.rows],
        "loops": diagnosis.loops and asdict(diagnosis.loops),
        "order": diagnosis.order and asdict(diagnosis.order),
        "attribution": why and _attribution(why),
        "torque_by_joint": [
            dict(zip(("component", "before", "after"), each, strict=True)) for each in diagnosis.by_joint
        ],
        "backfill": proof and {"on": proof.on, "left": asdict(proof.left), "why_not": proof.why_not},
        "libraries_together": diagnosis.together and asdict(diagnosis.together),
        "libraries": [asdict(witness) for witness in diagnosis.witnesses],
        "notes": diagnosis.notes,
        "doubts": diagnosis.doubts,
        "left_out": diagnosis.left_out,
    }


def _facts(model: Model) -> dict[str, Any]:
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


def _attribution(why: Attribution) -> dict[str, Any]:
    return {
        "before": asdict(why.before),
        "left": asdict(why.left),
        "share": why.share,
        "scale": SCALE,
        "causes": [_cause(cause) for cause in why.causes],
    }


def _cause(cause: Cause) -> dict[str, Any]:
    """`differences` are numbers of those in the list of all."""
    names = ("name", "sentence", "short", "kind", "share", "of_rest", "differences", "slips")
    return {name: getattr(cause, name) for name in names}


def _difference(each: Difference) -> dict[str, Any]:
    plain = {key: getattr(each, key) for key in ("item_a", "item_b", "what", "unit", "size", "kind", "sentence")}
    a, b = each.whole or (each.a, each.b)
    return {**plain, "a": a, "b": b}
