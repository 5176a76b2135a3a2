"""Forces that files contain but no engine includes, computed at the compared states and subtracted from answers.

A measured table includes the effects of rotors and friction; so may the answer of an engine for a user's model file.
Such answers are compared with the rigid machine after these forces have been subtracted.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations

import numpy as np

from screwgauge.judging.answer import Answer
from screwgauge.judging.assembly_modes import assembly_of
from screwgauge.judging.judge import answer_in_motion
from screwgauge.judging.left_out import LeftOutTerm, MeasuredParts, added_forces, left_out_terms, measured_parts
from screwgauge.problem import Problem, Rows
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.graph import layout
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution, Values, empty
from screwgauge.witness.constraints import AdmissibleMotion

FORCES = ("tree_force", "tree_force_soft", "generalized_force", "actuator_force", "reaction")
#: Largest number of array elements computed at once.
NUMBERS = 4_000_000
#: Largest fraction of a difference that may remain if left-out forces are to explain it.
LEFT = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class LeftOutForces:
    """Forces that a comparison leaves out.

    Attributes:
        terms: Terms grouped by kind; those of the description's own file come first.
        contained: Table or engine -> kinds of force that were subtracted from its values.
    """

    terms: tuple[LeftOutTerm, ...] = ()
    contained: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def inertia(self) -> tuple[str, ...]:
        """Inertia that is left out, even if it has no effect, in the notation of ``allow``: ``m1.armature``."""
        terms = (term for term in self.terms if term.inertia)
        return tuple(f"{name.partition(' ')[2]}.{term.kind}" for term in terms for name in term.names)


def without_left_out(
    scene: Scene, problem: Problem, answers: Mapping[str, Solution]
) -> tuple[dict[str, Solution], LeftOutForces]:
    """Subtract forces that no engine includes from the answers that contain them.

    Args:
        answers: Answers of tables and of engines, which list the additional forces in a user's model file.

    Returns:
        The answers, and the forces that were subtracted or left out.
    """
    every, solved = {**answers}, {name: one for name, one in answers.items() if name not in scene.tables}
    own = {name: one.left_out for name, one in solved.items() if one.left_out}
    if not (scene.mechanism.left_out or own):
        return every, LeftOutForces()
    base = next((one for one in solved.values() if _has_motion(scene, one)), None) or _follow(scene)
    if base is None:
        return every, LeftOutForces()
    rows = np.arange(len(scene.t)) if base.rows is None else base.rows
    moments = partial(_moments, scene, problem, base, rows)
    of_scene = partial(measured_parts, moments, scene.mechanism.left_out, scene.applied.springs)
    # an engine applies springs of the scene in addition to those of its file
    forces = {name: partial(measured_parts, moments, entries) for name, entries in own.items()}
    rigid, contained = (
        _forces_of(one for name, one in solved.items() if name not in own),
        dict[str, tuple[str, ...]](),
    )
    for name in (*(name for name in answers if name in scene.tables), *own):
        every[name], kinds = _take_off(every[name], rigid, forces.get(name, of_scene), rows)
        contained |= {name: kinds} if kinds else {}
    terms = [*left_out_terms(of_scene())] if scene.mechanism.left_out else []
    for name, entries in own.items():
        known = {(term.kind, term.names) for term in terms}  # terms of the file from which the description was made
        parts = measured_parts(moments, entries, scene.applied.springs)
        more = left_out_terms(parts, scene.models[name].name)
        terms += [term for term in more if (term.kind, term.names) not in known]
    return every, LeftOutForces(tuple(terms), contained)


def _follow(scene: Scene) -> Solution | None:
    """Follow a given motion if no engine returns poses; return None if the motion cannot be followed."""
    if scene.simulated:
        return None
    motion = scene.motion
    try:
        q = positions(layout(scene.mechanism), motion.y, motion.t, (motion.yd, motion.ydd))
    except ScrewgaugeError:  # engines report the error, too
        return None
    return Solution("", "", {}, empty(len(motion)), assembly=q)


def _forces_of(answers: Iterable[Solution]) -> dict[str, Values]:
    """Return each force from the first engine that computed it."""
    rigid: dict[str, Values] = {}
    for answer in answers:
        rigid = {**{name: answer.values[name] for name in FORCES if name in answer.values}, **rigid}
    return rigid


def _has_motion(scene: Scene, answer: Solution) -> bool:
    """Return True if an answer determines the motion of all joints."""
    has = {"joint_velocity", "joint_acceleration"} <= {*answer.values}
    return assembly_of(scene.mechanism, answer) is not None and (has or not scene.simulated)


def _moments(scene: Scene, problem: Problem, base: Solution, rows: Rows) -> Iterator[tuple[Answer, AdmissibleMotion]]:
    """Yield an answer in blocks of samples, adding the velocities and accelerations that it lacks."""
    mechanism = scene.mechanism
    at_once = max(1, NUMBERS // (6 * len(mechanism.bodies) * max(1, len(mechanism.coordinates))))
    for first in range(0, len(rows), at_once):
        yield answer_in_motion(mechanism, problem, base, rows[first : first + at_once])


def _take_off(
    answer: Solution, rigid: Mapping[str, Values], forces: Callable[[], MeasuredParts], rows: Rows
) -> tuple[Solution, tuple[str, ...]]:
    """Subtract from an answer the kinds of force whose removal brings it closest to the rigid machine."""
    values, contained = dict(answer.values), list[str]()
    for quantity in (name for name in rigid if name in answer.values):
        values[quantity], some = _nearest(values[quantity], rigid[quantity], quantity, forces, rows)
        contained += some
    kinds = tuple(dict.fromkeys(contained))
    if not kinds:
        return answer, ()
    note = f"its numbers included effects that no engine computes; these were subtracted: {', '.join(kinds)}"
    return replace(answer, values=values, notes=(*answer.notes, note)), kinds


def _nearest(
    values: Values, rigid: Values, quantity: str, forces: Callable[[], MeasuredParts], rows: Rows
) -> tuple[Values, tuple[str, ...]]:
    """Subtract the kinds of force that bring values closest to `rigid`; none if more than `LEFT` would remain."""
    names = tuple(name for name in values.components if name in rigid.components)
    own = values.pick(names)
    apart = own.array[rows] - rigid.pick(names).array[rows]
    seen = np.isfinite(apart).all(axis=1)
    if not seen.any() or not apart[seen].any():
        return values, ()
    added = added_forces(forces(), quantity, names)
    best: tuple[str, ...] = ()
    least = LEFT * float(np.abs(apart[seen]).max())
    for kinds in _choices([kind for kind, some in added.items() if some[seen].any()]):
        rest = float(np.abs(apart - sum(added[kind] for kind in kinds))[seen].max())
        if rest < least:
            best, least = kinds, rest
    if not best:
        return values, ()
    array = values.array.copy()
    columns = np.array([values.components.index(name) for name in names], dtype=np.intp)
    array[np.ix_(rows, columns)] -= sum(added[kind] for kind in best)
    return replace(values, array=array), best


def _choices(kinds: Collection[str]) -> Iterator[tuple[str, ...]]:
    """Yield all non-empty subsets of kinds, smallest first."""
    for n in range(1, len(kinds) + 1):
        yield from combinations(kinds, n)
