"""Compares two models of a machine: turns two files into facts, causes, text and a fix."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np

from screwgauge.diagnosis.answer import Diagnosis, diagnosis_of
from screwgauge.diagnosis.causes.causes import rank_causes
from screwgauge.diagnosis.causes.reasons import find_reasons
from screwgauge.diagnosis.deadline import LIMIT, Deadline
from screwgauge.diagnosis.explanation import explain
from screwgauge.diagnosis.facts.fact import Fact, mark_compiled, mark_rounding, other_gravity, select
from screwgauge.diagnosis.facts.structure import compare_content
from screwgauge.diagnosis.findings import Findings
from screwgauge.diagnosis.fix import make_fix
from screwgauge.diagnosis.libraries import check_libraries, compare_dynamics, compare_libraries
from screwgauge.diagnosis.machine.alignment import Names, find_partners, read_map
from screwgauge.diagnosis.machine.pair import Pair
from screwgauge.diagnosis.model import (
    Loops,
    Model,
    Read,
    Weighed,
    check_loops,
    load_side,
    loops_of_sides,
    match_cuts,
    read_here,
)
from screwgauge.diagnosis.shares import Torques, compare_orders, freedom_left, have_values, with_gravity, without_forces
from screwgauge.models.content import kinds
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import DescriptionError, UnknownNameError, check_seed, quote

#: Groups of properties that can be compared separately.
ONLY = ("rigid",)
#: Share of matched joints below which two models count as different machines; and number of identical names that is
#: unlikely to be chance: models with at least this number of identical names are compared in any case.
ALIKE, NO_CHANCE = 0.5, 5


def diagnose(
    a: str | Path | Weighed,
    b: str | Path | Weighed,
    *,
    map: str | Path | Mapping[str, str] | None = None,
    seed: int = 0,
    loops: Loops = None,
    limit: float = LIMIT,
    load: Read = read_here,
    only: str = "",
) -> Diagnosis:
    """Compare two models; see `screwgauge.api.diagnose` for arguments and errors.

    Args:
        a, b: Files or names, or copies by `model.weigh_side`, in which masses are computed from meshes.
    """
    check_seed(seed)
    deadline = Deadline(limit)
    if not isinstance(map, str | Path | Mapping | None):
        raise DescriptionError(f"{quote(map)} is neither a file nor a table of names", "map", "pass a file or a table")
    if only and only not in ONLY:
        raise UnknownNameError("part of a comparison", only, ONLY, "only")
    given = read_map(Path(map)) if isinstance(map, str | Path) else map
    first, second = loops_of_sides(loops, (a, b))
    one, two = check_loops(match_cuts(load_side(a, load, first), load_side(b, load, second), load))
    found = find((one, two), find_partners(one.reading, two.reading, given), seed, deadline, load, only)
    return diagnosis_of(found, datetime.now(UTC).isoformat(timespec="seconds"))


def find(
    models: tuple[Model, Model], names: Names, seed: int, deadline: Deadline, load: Read, only: str = ""
) -> Findings:
    """Compare two models.

    Args:
        names: Partners matched by name.
        only: The only group of properties to compare; empty for all.
    """
    a, b = models
    marked = partial(mark_rounding, digits=(a.digits, b.digits), longest=(a.longest, b.longest))
    told = explain(*_share_gravity(a.posed, b.posed), names, marked)
    pair = told.pair
    start = Findings(
        a, b, seed, pair, dict(_origins(pair, names)), _are_comparable(pair, names), limit=deadline.seconds, only=only
    )
    if not start.alike:
        return start
    content, withheld, aside = ([], (), ()) if only else compare_content(pair)
    facts = select([*_drop_given_names(told.facts, start.how), *content], only)
    facts = tuple(mark_compiled(marked(facts), [model.library for model in models]))
    found = replace(
        start, facts=facts, standing=told.standing, withheld=withheld, aside=aside, mobility=_mobility(models)
    )
    if not deadline.is_over("order of the joints"):
        joints = {name: partner.name for name, partner in pair.joints.items()}
        found = replace(found, order=compare_orders(models, joints, seed))
    found = _add_causes(found, deadline)
    found = replace(found, witnesses=tuple(check_libraries(models, seed, deadline)))
    if _is_outside_torques(found) and not deadline.is_over("torques of the libraries for the loaded files"):
        skipped = bool(only) or bool(other_gravity(a.reading, b.reading))
        both, why_not = (None, "") if skipped else compare_libraries(models, pair, seed)
        found = replace(found, agreement=compare_dynamics(pair, seed, only), together=both, why_not=why_not)
    if any(fact.kind != "digits" for fact in facts) and not deadline.is_over("proof by a corrected file"):
        found = replace(found, fix=make_fix(a, b, pair, load, moved=told.whole is not None, only=only))
    return replace(found, left_out=tuple(deadline.left_out))


def _share_gravity(a: Reading, b: Reading) -> tuple[Reading, Reading]:
    """Copy the gravity of one reading to the other if the other lacks gravity."""
    stated = a.gravity if b.gravity is None else b.gravity
    one, two = (replace(each, gravity=stated) if each.gravity is None else each for each in (a, b))
    return one, two


def _is_outside_torques(found: Findings) -> bool:
    """Return True if the torques of bodies and joints do not depend on any property that differs."""
    outside = {*kinds(), "density", "viscosity"}
    return found.agrees or (bool(found.facts) and all(fact.what in outside for fact in found.facts))


def _drop_given_names(facts: Iterable[Fact], how: Mapping[str, str]) -> list[Fact]:
    """Drop differences in names that the user mapped."""
    return [fact for fact in facts if not (fact.what == "name" and how.get(fact.part) == "given")]


def _add_causes(found: Findings, deadline: Deadline) -> Findings:
    """Add causes, their shares and reasons to findings."""
    facts = found.facts
    if not facts or deadline.is_over("causes and their shares"):
        return found
    reading = with_gravity(found.pair.a.reading)
    torques = Torques(without_forces(reading) if found.only else reading, found.seed)
    why = tuple(find_reasons(facts, found.pair, (found.a.file, found.b.file)))
    ranked = tuple(rank_causes(facts, torques, [each.facts for each in why]))
    found = replace(found, causes=ranked, reasons=why)
    shared = [fact for cause in ranked if not np.isnan(cause.share) for fact in cause.facts if have_values([fact])]
    effect = torques.effect(shared)
    if effect is None:
        return found
    most = np.abs(effect / torques.scale).max(axis=0, initial=0.0)
    return replace(found, torques=torques.largest(effect), by_joint=tuple(zip(torques.names, most, strict=True)))


def _mobility(models: Sequence[Model]) -> tuple[int, int] | None:
    """Count the degrees of freedom of each model with its loops closed.

    Return None if no model has loops, or if a model has no closed pose near its home pose.
    """
    readings = [model.posed for model in models]
    if not any(reading.closures or reading.couplings for reading in readings):
        return None
    a, b = map(freedom_left, readings)
    return (a, b) if min(a, b) >= 0 else None


def _origins(pair: Pair, names: Names) -> Iterator[tuple[str, str]]:
    """Yield each joint of A and how its partner was found."""
    for name, partner in pair.joints.items():
        if names.joints.get(name) == partner.name:
            yield name, names.how.get(name, "name")
        else:
            yield name, f"geometry{', against its name' if pair.crosses_names(name) else ''}"


def _are_comparable(pair: Pair, names: Names) -> bool:
    """Return True if enough joints are matched for a comparison, by name or by geometry."""
    counts = [len(machine.reading.joints) - len(pair.joints) for machine in (pair.a, pair.b)]
    if not pair.joints or pair.complete:
        return bool(pair.joints) or not any(machine.reading.joints for machine in (pair.a, pair.b))
    known = [how for name, how in names.how.items() if name in pair.joints]
    enough = len(known) >= ALIKE * (len(pair.joints) + min(counts))
    most = len(pair.joints) >= ALIKE * (len(pair.joints) + max(counts))
    return "given" in known or enough or most or known.count("name") >= NO_CHANCE
