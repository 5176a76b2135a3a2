"""What two models say of loops, couplings and actuators, and what these leave of motion, whichever rows state it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Polynomial

from screwgauge.diagnosis.compare import Row, components, row_of
from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.differences.difference import Difference, another, differ, difference, only
from screwgauge.diagnosis.differences.geometry import matter_apart, step_of
from screwgauge.diagnosis.differences.words import axes_of, compared, turn_and_way, vector
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.pairing.common import ROUNDING, Common, states_of_b, velocity_map
from screwgauge.diagnosis.pairing.mapping import CLOSE, Pairing, apart
from screwgauge.diagnosis.properties import PASSIVE, Change, unit_of
from screwgauge.diagnosis.transformations import axis, outwards
from screwgauge.models.files.mjcf import SOFTNESS
from screwgauge.models.importing.assemble import assemble
from screwgauge.models.importing.homes import Loops as LoopEquations
from screwgauge.models.importing.homes import some
from screwgauge.models.kinematics import ReadingTree, draw, moved, near_home, plant, rehomed, residual_at_home, size
from screwgauge.models.poses import exponential
from screwgauge.models.readings.reading import ClosureReading, Reading
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.rotations import Array, rotation_vector
from screwgauge.witness.constraints import admissible_projector, clear, closed, equations
from screwgauge.witness.tree import TreeStates

#: Gaps at home up to this are closed [m or rad].
CLOSED = 1e-9


def closures(common: Common, as_written: Common) -> Iterator[Difference]:
    """Differences of the closures that both have, with their gaps; then closures of one model alone, A's first.

    Args:
        as_written: The two before B's geometry was corrected, which say how far their loops are open.
    """
    gaps = [residual_at_home(plant(each)) for each in (as_written.a, as_written.b)]
    same = all(as_written.a.joints[name].home == q for name, q in as_written.homes.items())
    at = "home" if same else "A's home"
    for name in common.a.closures:
        if name in common.b.closures:
            yield from _closure(common, name, (gaps[0][name], gaps[1][name]), at)
            yield from _softness(common, "closures", name)
    for side, here, there, open_ in (("A", common.a, common.b, gaps[0]), ("B", common.b, common.a, gaps[1])):
        for name, closure in here.closures.items():
            if name not in there.closures:
                own = common.own["closures"].get(name, name) if side == "B" else name
                sentence = f"{own}: a closure of {closure.first} and {closure.second} in {side} only"
                if open_[name] > CLOSED:
                    sentence += f", at {at} open by {_gap(closure, open_[name])}"
                yield only(side, own, "closure", sentence)


def _gap(closure: ClosureReading, gap: float) -> str:
    return f"{gap:.3g} m" if closure.kind == "point" else f"{gap:.3g} m or rad"


def _closure(common: Common, name: str, gaps: tuple[float, float], at: str) -> Iterator[Difference]:
    a, b = common.a.closures[name], common.b.closures[name]
    open_ = max(gaps) > CLOSED
    states = [
        f"open by {_gap(each, gap)}" if gap > CLOSED else "closed" for each, gap in zip((b, a), gaps[::-1], strict=True)
    ]
    still = f"; at {at} {states[0]} in B, {states[1]} in A" if open_ else ""
    if a.kind != b.kind:
        sentence = f"{name}: a {b.kind} in B, a {a.kind} in A{still}"
        yield another(common, "closures", name, "closure", sentence)
    if (a.first, a.second) == (b.second, b.first) and a.first != a.second:
        a = replace(a, first=a.second, first_frame=a.second_frame, second=a.first, second_frame=a.first_frame)
    steps = {}
    for what, body in (("first_frame", a.first), ("second_frame", a.second)):
        ours, theirs = getattr(a, what), getattr(b, what)
        if body in common.a.bodies and body in common.b.bodies:
            ours = np.linalg.inv(common.b.bodies[body].pose) @ common.a.bodies[body].pose @ ours
        steps[what] = body, ours, theirs
    if a.kind == b.kind == "point" and _along_hinge(common, name, steps):
        return
    moved = False
    for what, (body, ours, theirs) in steps.items():
        step = float(np.linalg.norm(ours[:3, 3] - theirs[:3, 3]))
        turn = float(np.abs(ours[:3, :3] - theirs[:3, :3]).max()) if a.kind == b.kind == "weld" else 0.0
        if max(step / size(common.a), turn) > 10 * common.rounding:
            R = common.b.bodies[body].pose[:3, :3] if body in common.b.bodies else np.eye(3)
            w = rotation_vector(np.asarray(theirs[:3, :3] @ ours[:3, :3].T)) if turn else np.zeros(3)
            way = np.array([R @ w, R @ (theirs - ours)[:3, 3]])
            told = turn_and_way(way, axes_of(common.a, body), size(common.a))
            if what == "second_frame" and a.derived and b.derived and at == "home" and not (open_ or moved):
                continue  # it follows from joints between the two frames that are elsewhere
            moved = True
            more = step / size(common.a) + turn, f"{name}: its frame on {body} is elsewhere in B, {told}{still}"
            yield difference(common, name, what, ours, theirs, more)


def _along_hinge(common: Common, name: str, steps: Mapping[str, tuple[str, Array, Array]]) -> bool:
    """Whether a point of B is another one of the axis of the same hinge, on which several points of one model lie.

    Args:
        steps: Of both frames the body, and A's and B's in the frame of B's body.
    """
    moved = []
    for body, ours, theirs in steps.values():
        R = common.b.bodies[body].pose[:3, :3] if body in common.b.bodies else np.eye(3)
        moved.append(R @ (theirs[:3, 3] - ours[:3, 3]))
    near = CLOSE * size(common.a)
    if np.linalg.norm(moved[0] - moved[1]) > near:
        return False
    for reading in (common.a, common.b):
        ends = {reading.closures[name].first, reading.closures[name].second}
        alike = [c for c in reading.closures.values() if c.kind == "point" and {c.first, c.second} == ends]
        pose = reading.bodies[alike[0].first].pose if alike[0].first in reading.bodies else np.eye(4)
        there = [c.first_frame if c.first == alike[0].first else c.second_frame for c in alike]
        cloud = np.array([(pose @ T)[:3, 3] for T in there])
        s, V = np.linalg.svd(cloud - cloud.mean(axis=0))[1:]
        if len(cloud) > 1 and s[0] > near and s[1] < near and np.linalg.norm(np.cross(V[0], moved[0])) < near:
            return True
    return False


def _padded(a: Array, b: Array) -> tuple[Array, Array]:
    """Coefficients of two polynomials, as many of both."""
    n = max(len(a), len(b))
    return np.pad(a, (0, n - len(a))), np.pad(b, (0, n - len(b)))


def couplings(common: Common, shifts: Mapping[str, float]) -> Iterator[Difference]:
    """Couplings that one alone has, that follow other joints, or in another way.

    Args:
        shifts: Joint -> by which A counts more in the same place.
    """
    for name, coupling in common.a.couplings.items():
        other = common.b.couplings.get(name)
        if other is None:
            sentence = f"{coupling.joint} follows {coupling.of or 'nothing'} in A only"
            yield only("A", name, "coupling", sentence, coupling.polynomial, "1")
            continue
        if coupling.of != other.of:
            leads = common.own["joints"].get(other.of, other.of) or "nothing"
            sentence = f"{coupling.joint}: follows {leads} in B, {coupling.of or 'nothing'} in A"
            yield another(common, "couplings", name, "leading joint", sentence)
        a, b = _padded(coupling.polynomial, other.polynomial)
        if np.abs(a - b).max() > ROUNDING * max(float(np.abs(a).max()), float(np.abs(b).max())):
            one = difference(common, name, "polynomial", a, b)
            line = Polynomial([-shifts.get(other.of, 0.0), 1.0])
            there = Polynomial(other.polynomial)(line) + shifts.get(other.joint, 0.0)
            first, second = _padded(coupling.polynomial, np.asarray(there.coef, dtype=float))
            if shifts and np.abs(first - second).max() <= CLOSE * float(np.abs(first).max()):
                sentence = f"{one.sentence}: the same, as zeros are elsewhere"
                one = replace(one, kind="convention", sentence=sentence)
            elif shifts and _of_free_zero(common.b, other.of, first, second):
                sentence = f"{one.sentence}: the same, as zeros are elsewhere, that of {coupling.of} among them"
                one = replace(one, kind="convention", sentence=sentence)
            yield one
        yield from _softness(common, "couplings", name)
    for name, coupling in common.b.couplings.items():
        if name not in common.a.couplings:
            sentence = f"{coupling.joint} follows {coupling.of or 'nothing'} in B only"
            own = common.own["couplings"].get(name, name)
            yield only("B", own, "coupling", sentence, coupling.polynomial, "1")


def _of_free_zero(b: Reading, of: str, first: Array, second: Array) -> bool:
    """Whether two couplings are the same but for the zero of a leading hinge, which nothing else in a model shows.

    Args:
        first, second: Coefficients of both, as A counts what follows. Shape (n,).
    """
    if of not in b.joints or b.joints[of].kind != "hinge" or not second[1]:
        return False
    zero = float(second[0] - first[0]) / float(second[1])
    there, _ = _padded(np.asarray(Polynomial(second)(Polynomial([-zero, 1.0])).coef), first)
    return bool(np.abs(there - first).max() <= CLOSE * np.abs(first).max()) and _unseen(b, of, zero)


def _unseen(reading: Reading, joint: str, angle: float) -> bool:
    """Whether nothing shows where a hinge counts from: what it carries is round, or its parent, on one axis."""
    hinge, length = reading.joints[joint], size(reading)
    T = exponential("hinge", axis(hinge), hinge.centre, angle)
    bodies, joints = outwards(reading, joint)
    if _stays(reading, bodies, joints, T):
        return True
    near = reading.bodies[reading.moved_by(joint)].near
    previous = reading.bodies[near].joints[-1] if near in reading.bodies else joint
    if previous == joint or apart(reading.joints[previous], hinge, length) > CLOSE:
        return False
    before, others = outwards(reading, previous)
    return _stays(reading, [n for n in before if n not in bodies], [n for n in others if n not in joints], T)


def _stays(reading: Reading, bodies: Sequence[str], joints: Sequence[str], T: Array) -> bool:
    """Whether matter of bodies, joints and ends of loops are where they were after a turn. T: shape (4, 4)."""
    length = size(reading)
    off = [apart(reading.joints[name], moved(reading.joints[name], T), length) for name in joints]
    for name in bodies:
        off += matter_apart(reading.bodies[name], reading.bodies[name], T, length)
    for closure in reading.closures.values():
        for name, frame in ((closure.first, closure.first_frame), (closure.second, closure.second_frame)):
            if name in bodies:
                turn, way = np.linalg.norm(step_of(T, (reading.bodies[name].pose @ frame)[:3, 3]), axis=1)
                off += [float(way) / length, float(turn) if closure.kind == "weld" else 0.0]
    return max(off) < CLOSE


def actuators(common: Common, turned: Collection[str]) -> Iterator[Difference]:
    """Actuators that one alone has, that drive other joints, or through another gear.

    Args:
        turned: Joints that count the other way in B.
    """
    if not (common.a.actuators and common.b.actuators):
        return  # one of the formats has none
    for name, (joint, gear) in common.a.actuators.items():
        if name not in common.b.actuators:
            yield only("A", name, "actuator", f"{name}: an actuator of {joint} in A only", np.asarray(gear), "1")
            continue
        driven, other = common.b.actuators[name]
        if driven != joint:
            sentence = f"{name}: drives {common.own['joints'].get(driven, driven)} in B, {joint} in A"
            yield another(common, "actuators", name, "driven joint", sentence)
        if differ(gear, other):
            one = difference(common, name, "gear", np.asarray(gear), np.asarray(other))
            if joint in turned and not differ(gear, -other):
                sentence = f"{one.sentence}: the same motor, as its joint counts the other way"
                one = replace(one, kind="convention", sentence=sentence)
            yield one
    for name, (joint, gear) in common.b.actuators.items():
        if name not in common.a.actuators:
            own = common.own["actuators"].get(name, name)
            yield only("B", own, "actuator", f"{own}: an actuator of {joint} in B only", np.asarray(gear), "1")


def cut_joints(models: tuple[Model, Model]) -> Iterator[Difference]:
    """What joints say that are compared as points, as their links are cut in the other model or in both."""
    a, b = (model.cut for model in models)
    ours, theirs = ((model.as_read or model.reading).joints for model in models)
    pairs = [(link.joints, link.partners) for link in a.points] + [*a.merged] if a else []
    named_by_a = {name for _, partners in pairs for name in partners}
    if b:
        pairs += [((), link.joints) for link in b.points if not named_by_a & {*link.joints}]
        pairs += [(partners, joints) for joints, partners in b.merged]
    for one, other in pairs:
        sides = [ours[name] for name in one], [theirs[name] for name in other]
        for what in PASSIVE:
            first, second = (max((getattr(joint, what) for joint in side), default=0.0) for side in sides)
            if not differ(first, second):
                continue
            item, joint = (*one, *other)[0], (*sides[0], *sides[1])[0]
            size_, sentence = compared(item, what, np.array(first), np.array(second), unit := unit_of(what, joint))
            closed = [side for side, names in zip("AB", (one, other), strict=True) if not names]
            where = f"; {closed[0]} has points in place of the joint" if closed else ""
            named = ((*one, "")[0], (*other, "")[0])
            yield Difference(*named, what, np.array(first), np.array(second), unit, size_, sentence + where)


def _softness(common: Common, kind: str, name: str) -> Iterator[Difference]:
    """Difference in softness of a constraint that both libraries keep by springs; exact constraints have none."""
    a, b = (np.array(getattr(each, kind)[name].softness) for each in (common.a, common.b))
    if a.size == b.size and np.any(np.abs(a - b) > ROUNDING * np.maximum(np.abs(a), np.abs(b))):
        parts = [
            f"{word} {vector(b[part], a[part])} in B, {vector(a[part], b[part])} in A"
            for word, part in SOFTNESS.items()
            if not np.array_equal(a[part], b[part])
        ]
        apart = float((np.abs(a - b) / np.maximum(np.maximum(np.abs(a), np.abs(b)), 1e-300)).max())
        sentence = f"{name}: softness, {'; '.join(parts)}"
        change = Change(common.own[kind].get(name, name), "softness", a)
        yield Difference(name, change.item, "softness", a, b, "", apart, sentence, change)


#: States that are drawn, and closed where they can be.
DRAWN = 12
#: Scaled motions that loops leave and that differ by no more are the same: rounding over small singular values.
ALIKE = 1e-9
#: Gaps at home up to this are closed, as those of a description are [rad or lengths of the model].
HOME = 1e-9
#: Conventions of coordinates that are corrected before loops are compared: the same pose is meant.
COUNTED = ("zero", "sign", "polynomial")
_NOT_COMPARED = "what closures and couplings leave is not compared"


@dataclass(frozen=True, slots=True)
class Loops:
    """Closures and couplings of two models at closed states.

    Attributes:
        row: Difference of what they leave of unit velocities, as projectors.
        mobility: Degrees of freedom that they leave in A and in B; `freedoms` without them.
        states: At how many states.
        opened: How far B is open at poses that close A, in words; empty where they close B, too.
    """

    row: Row
    mobility: tuple[int, int]
    freedoms: int
    states: int
    opened: str = ""

    @property
    def closes_alike(self) -> bool:
        """Whether the same poses close both, and leave as many freedoms."""
        return self.mobility[0] == self.mobility[1] and not self.opened

    @property
    def alike(self) -> bool:
        """Whether they leave the same motions, at the same poses; near singular ones rounding may hide it."""
        return self.closes_alike and self.row.max_abs <= ALIKE


def at_home(models: tuple[Model, Model]) -> tuple[Model, Model]:
    """Both models, with how far their loops are open at home and whether they close at all.

    Raises:
        ClosureError: Loops of neither close from any start.
    """
    measured, refused = list[Model](), list[ClosureError]()
    for model in models:
        system = LoopEquations(plant(rehomed(model.reading, model.home)[0]))
        gaps = system.gaps(system.home, HOME)
        try:
            assemble(model.reading, model.label, {}) if gaps else None
            measured.append(replace(model, open_by=some(gaps)))
        except ClosureError as error:
            refused.append(error)
            measured.append(replace(model, open_by=some(gaps), never_closed=error.what))
    if len(refused) == len(models):
        raise refused[0]
    return measured[0], measured[1]


def loops(common: Common, pairing: Pairing, seed: int, deadline: Deadline) -> tuple[Loops | None, str]:
    """What loops leave in both models, and a sentence on it; None where that is not compared.

    Where B is open at a state that closes A, which is said, the nearest is taken that closes B.
    """
    bound = any(each.closures or each.couplings for each in (common.a, common.b))
    if not bound or deadline.over("what loops leave of motion"):
        return None, ""
    if pairing.only_a or pairing.only_b:
        return None, f"{_NOT_COMPARED}: joints are in one model only"
    a, b = plant(common.a), plant(common.b)
    force, length = components(common.a), size(common.a)
    slides = np.array([unit == "N" for _, unit in force])
    why = "no random state closes both models"
    for drawn in (draw(common.a, DRAWN, seed), near_home(a, DRAWN, np.where(slides, length, 1.0), seed)):
        states, _ = closed(a, drawn)
        same_poses = states_of_b(a, b, states)
        theirs, fits = closed(b, same_poses)
        rows = equations(a, states.at(fits)).rows, equations(b, theirs).rows @ velocity_map(a, b)
        regular = clear(rows[0]) & clear(rows[1])
        if regular.any():
            break
        why = "all random states that close both models are singular" if fits.any() else why
    else:
        return None, f"{_NOT_COMPARED}: {why}"
    rows = rows[0][regular], rows[1][regular]
    ours, others = (admissible_projector(each, slides, length)[0] for each in rows)
    n, m = (round(float(np.median(np.trace(each, axis1=1, axis2=2)))) for each in (ours, others))
    row = row_of(
        "motion that loops leave", ours, others, [(x, "") for x, _ in force for _ in force], np.ones_like(ours)
    )
    freedoms = f"closures and couplings leave {n} of {len(force)} degrees of freedom" if n == m else ""
    return Loops(row, (n, m), len(force), len(ours), _opened(b, same_poses)), freedoms


def _opened(tree: ReadingTree, states: TreeStates) -> str:
    """How far loops are open where they are widest, in words; empty where they are closed at all states."""
    system = LoopEquations(tree)
    widest = max(states.q, key=lambda q: float(np.abs(system.system(q)[0]).max(initial=0.0)))
    return some(system.gaps(widest, ALIKE))
