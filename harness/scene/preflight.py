"""Checks of a scene before any engine runs: home pose, limits, singular poses, implausible values."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from screwgauge.models.home import check_home
from screwgauge.problem import GivenMotion
from screwgauge.quantities import ACTUATED, GIVEN, RULED
from screwgauge.reference import linear
from screwgauge.reference.closed.assembly_mode import AssemblyMode
from screwgauge.reference.closed.continuation import PathEnd
from screwgauge.reference.closed.loops import loop_equations, read
from screwgauge.reference.errors import ClosureError, DescriptionError, JointLimitError, SingularPoseError, first_few
from screwgauge.reference.graph import Layout, layout
from screwgauge.reference.lint import TURNED, WRITTEN, hinges, implausible, in_degrees
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.mobility import Mobility, mobility, near_singularity
from screwgauge.reference.rotations import Array
from screwgauge.scene.assumed import check_rest
from screwgauge.scene.idle import undriven_labels
from screwgauge.scene.scene import Scene

PART = 2048
FAR = 0.25  # distance of the start from home that causes a warning [rad or lengths of the mechanism]
FARTHEST = 1000.0  # largest distance between samples [rad or m]; following it takes thousands of steps, i.e. seconds
NEAR = 1e-9  # distance from the singular pose at the end of a path within which a sample is singular [rad or lengths]


def check_scene(scene: Scene) -> Mobility:
    """Follow the whole motion, using only the description.

    Returns:
        Counts of the degrees of freedom; a force counts as unique only if it is unique at every pose examined.

    Raises:
        ScrewgaugeError: The motion exceeds a limit, the loops do not close, or a pose is singular.
    """
    check_rest(scene)
    try:
        return _walk(scene.mechanism, scene.motion)
    except (ClosureError, JointLimitError, SingularPoseError) as error:
        remedy = "; ".join([error.remedy, *far_from_home(scene)])
        raise type(error)(error.what, error.where, remedy) from None


def far_from_home(scene: Scene) -> tuple[str, ...]:
    """Warn if the motion starts far from home, e.g. because its values are relative to the home pose."""
    mechanism, start = scene.mechanism, scene.motion.y[0]
    home = mechanism.home[mechanism.independent_columns]
    size = loop_equations(layout(mechanism)).sizes[mechanism.independent_columns]
    if (np.abs(start - home) <= FAR * size).all():
        return ()
    places = mechanism.pose_text(start), mechanism.pose_text(home)
    return (f"the motion starts at {places[0]}; the home pose is {places[1]} (coordinates are not measured from home)",)


@lru_cache(maxsize=1)  # both arguments are immutable, and a smoke test runs a scene several times
def _walk(mechanism: Mechanism, whole: GivenMotion) -> Mobility:
    lay = check_home(mechanism)
    _check_jumps(mechanism, whole)
    walk, looked_at = SampleWalk(lay), list[Array]()
    rows = np.unique(np.linspace(0, len(whole) - 1, 7).astype(int))
    for first in range(0, len(whole), PART):
        motion = whole.part(slice(first, first + PART))
        q = walk.part(motion)
        if beyond := beyond_limits(lay.mechanism, q, unit=True):
            i, sentence = beyond
            raise JointLimitError(
                f"joint coordinate {sentence} at {lay.mechanism.pose_text(motion.y[i])}",
                f"t = {motion.t[i]:g} s",
                "shorten the motion or widen the limits",
            )
        looked_at += [q[i - first] for i in rows if first <= i < first + PART]
    return _mobility(lay, [*read(lay, np.array(looked_at))])


def check_actuation(
    scene: Scene, freedoms: Mobility, quantities: Collection[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the quantities that the actuators determine, and a sentence on any that are omitted by default.

    Raises:
        DescriptionError: No forces, or none that follow the rule, satisfy the equations of motion.
    """
    ruled = [name for name in quantities if name in ACTUATED]
    rest = tuple(name for name in quantities if name not in ruled)
    mechanism = scene.mechanism
    driven = len(mechanism.actuator_names) - freedoms.actuation_redundancy
    moved = len(mechanism.independent) - len(scene.undriven)
    if driven < moved:
        short = f"the actuated joints drive {driven} of {moved} freedoms"
        remedy = _left_to_forces(mechanism, driven)
        if {*quantities} == {*GIVEN}:
            return rest, (f"{' and '.join(ruled)} are left out: {short} ({remedy} to compare them)",)
        if ruled:
            raise DescriptionError(short, mechanism.where, f"{remedy} or do not request {' and '.join(ruled)}")
    if len(rest) == len(quantities):
        return rest, ()
    if scene.rule == "spherical_axial" and RULED & {*ruled} and freedoms.actuation_redundancy != 2:
        raise DescriptionError(
            f"rule spherical_axial needs 2 redundant actuators, not {freedoms.actuation_redundancy}",
            mechanism.where,
            "use the rule min_norm",
        )
    return tuple(quantities), ()


def _left_to_forces(mechanism: Mechanism, driven: int) -> str:
    """Return a remedy for scenes in which actuators do not drive all degrees of freedom."""
    if not driven:
        return "actuate more joints"
    names = first_few((f"'{label}'" for label in undriven_labels(mechanism)), 4)
    return f"remove {names} from [motion], so that the motion follows from the forces,"


def determined_at_home(scene: Scene, quantities: Collection[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the result of `check_actuation` for counts at the home pose, if the motion is not known yet."""
    lay = check_home(scene.mechanism)
    return check_actuation(scene, mobility(lay, scene.mechanism.home[None]), quantities)


def _check_jumps(mechanism: Mechanism, motion: GivenMotion) -> None:
    """Reject a motion with samples that are too far apart to be followed."""
    way = np.diff(motion.y, axis=0, prepend=mechanism.home[mechanism.independent_columns][None])
    size = loop_equations(layout(mechanism)).sizes[mechanism.independent_columns]
    far = np.argwhere(np.abs(way) / np.maximum(size, 1.0) > FARTHEST)
    if far.size:
        i, unit = far[0, 0], mechanism.units[mechanism.independent_columns[far[0, 1]]]
        raise DescriptionError(
            f"the motion jumps to {mechanism.pose_text(motion.y[i])}, "
            f"more than {FARTHEST:g} {unit} from the previous sample or the home pose",
            f"t = {motion.t[i]:g} s",
            "check its units or take shorter steps",
        )


def beyond_limits(mechanism: Mechanism, q: Array, *, unit: bool = False) -> tuple[int, str] | None:
    """Return the first sample of joint coordinates, shape (n, n_q), that exceeds a limit, and a sentence about it."""
    low, high = mechanism.limits.T
    beyond = np.argwhere((q < low) | (q > high))
    if not len(beyond):
        return None
    i, k = beyond[0]
    value = f"{q[i, k]:.6g}{f' {mechanism.units[k]}' if unit else ''}"
    return i, f"'{mechanism.coordinates[k]}' = {value} is outside its limits [{low[k]:g}, {high[k]:g}]"


def limits_left(mechanism: Mechanism, q: Array) -> list[str]:
    """List the coordinates that exceed their limits in any sample, and these limits. `q`: shape (n, n_q)."""
    low, high = mechanism.limits.T
    beyond = ((q < low) | (q > high)).any(axis=0)
    rows = zip(mechanism.coordinates, low, high, mechanism.units, beyond, strict=True)
    return [f"'{name}' ([{a:g}, {b:g}] {unit})" for name, a, b, unit, left in rows if left]


class SampleWalk:
    """Path along a motion from home, followed part by part; errors are stated in terms of the description.

    A pose is also singular if coordinates that are constant on the home branch may begin to move there. Charts of cut
    joints are not among the unknowns; where such a chart locks, only the rates of that joint are undefined.
    """

    def __init__(self, lay: Layout) -> None:
        self.lay, self.mode = lay, AssemblyMode(lay, strict=True)
        self.system = self.mode.system
        self.before: float | None = None

    def part(self, motion: GivenMotion) -> Array:
        """Return joint coordinates over part of the motion, approximate for cut joints without limits. Shape (n, n_q).

        Raises:
            ClosureError: The loops cannot close.
            SingularPoseError: A pose is singular, or the path passes a singular pose.
        """
        mechanism = self.lay.mechanism
        try:
            poses = self.mode.predict(motion.y, motion.t, (motion.yd, motion.ydd), motion.drive)
            z, matrix, _, *more = self.mode.follow(poses)
        except PathEnd as end:
            if not end.beyond:
                raise ClosureError(end.what, end.where, end.remedy) from None
            raise self._passage(end, motion) from None
        matrix = more[0] if more else matrix
        regular = (linear.invert_along(matrix)[1] <= linear.SINGULAR).all()
        q = self.system.tree(z, self.mode.joints(poses))
        if not regular or np.isfinite(mechanism.limits[self.lay.cut_columns]).any():
            q = self.system.coordinates(z, q)
        if not regular:
            check_regular(self.lay, q, motion.t, motion.y, matrix)
        self.before = float(motion.t[-1])
        return q

    def _passage(self, end: PathEnd, motion: GivenMotion) -> SingularPoseError:
        """Build the error for a motion that passes a singular pose."""
        ended = self.system.coordinates(end.z[None], self.lay.mechanism.home[None])
        near = near_singularity(self.lay, ended)
        meets, pose_text = self.lay.mechanism.pose_text(end.y), self.lay.mechanism.pose_text
        times = motion.t if self.before is None else np.append(self.before, motion.t)
        i = int(np.flatnonzero(times == end.t)[0])
        if np.abs((end.y - motion.y[i - len(times)]) / self.mode.unit).max() < NEAR:
            check_regular(self.lay, ended, np.array([end.t]), end.y[None])
        if not i:
            return SingularPoseError(
                f"a singular pose separates the start of the motion, {pose_text(motion.y[0])}, from home "
                f"(the path from home is singular at {meets}): {near}",
                f"t = {times[0]:g} s",
                "keep the motion on the same side as home, or choose a home pose beyond the singular pose",
            )
        what = f"the motion passes through a singular pose near {meets}: {near}"
        return SingularPoseError(
            what, f"between t = {times[i - 1]:g} s and {end.t:g} s", "keep the motion away from it"
        )


def check_regular(lay: Layout, q: Array, t: Array, y: Array, matrix: Array | None = None) -> None:
    """Check the condition number of the closing system (`matrix`, if known) at every sample.

    Raises:
        SingularPoseError: A pose is singular.
    """
    condition = linear.condition(loop_equations(lay).matrix(q) if matrix is None else matrix)
    bad = np.flatnonzero(~(condition <= linear.SINGULAR))
    if bad.size:
        i = bad[0]
        raise SingularPoseError(
            f"the pose {lay.mechanism.pose_text(y[i])} is singular (condition {condition[i]:.1e}): "
            f"{near_singularity(lay, q[bad[:1]])}",
            f"t = {t[i]:g} s",
            "keep the motion away from it",
        )


def _mobility(lay: Layout, poses: Sequence[Array]) -> Mobility:
    """Count degrees of freedom at the most general of a few poses, because symmetry can make forces look unique.

    Only the given poses (joint coordinates) with the highest rank are used, because rounding affects ranks near
    singular poses; if no given pose has this rank, only the home pose is used.
    """
    *sampled, home = (mobility(lay, q[None]) for q in [*poses, lay.mechanism.home])

    def ranks(one: Mobility) -> tuple[int, int]:
        return one.constraint_rank, -one.actuation_redundancy

    most = max([*sampled, home], key=ranks)
    general = [one for one in sampled if ranks(one) == ranks(most)] or [most]
    unique = tuple(all(flags) for flags in zip(*(one.unique for one in general), strict=True))
    determined = tuple(all(flags) for flags in zip(*(one.determined for one in general), strict=True))
    return replace(most, unique=unique, determined=determined)


#: Largest rate at both ends of a motion from rest to rest, relative to the largest rate in between.
REST = 1e-6


def doubts(scene: Scene) -> tuple[str, ...]:
    """Return warnings about bodies, joints and motion."""
    return (*implausible(scene.mechanism), *(_start_doubts(scene) if scene.simulated else _motion_doubts(scene)))


def _angles(scene: Scene) -> Iterator[tuple[int, str, int]]:
    """Yield the independent coordinates that are hinge angles: index, label and column."""
    mechanism, free = scene.mechanism, {joint.coordinates[i] for joint, i in hinges(scene.mechanism)}
    for k, label in enumerate(mechanism.independent):
        column = int(mechanism.independent_columns[k])
        if mechanism.coordinates[column] in free:
            yield k, label, column


def _start_doubts(scene: Scene) -> Iterator[str]:
    """Warn about angles that start more than one revolution from home."""
    for k, label, column in _angles(scene):
        value = float(scene.start.start[k])
        if abs(value - scene.mechanism.home[column]) > 2.0 * np.pi:
            yield f"the start {label} = {value:g} rad is more than a turn from home ({WRITTEN})"


def _motion_doubts(scene: Scene) -> Iterator[str]:
    """Warn about angles that start over a turn from home, or make over two turns and reverse or go from rest to rest.

    Angles that keep turning in one direction, like that of a crank, may make any number of revolutions.
    """
    motion, home = scene.motion, scene.mechanism.home
    for k, label, column in _angles(scene):
        y, yd = motion.y[:, k], motion.yd[:, k]
        way = float(np.ptp(y))
        if abs(y[0] - home[column]) > 2.0 * np.pi:
            yield f"{label}: {in_degrees('a start', float(y[0]))} ({WRITTEN})"
        elif way > TURNED and (_returns(y) or _rests(yd)):
            yield f"{label}: {in_degrees('a motion', way)} ({WRITTEN})"


def _returns(y: Array) -> bool:
    """Return True if a coordinate reverses by more than one revolution. Shape (n,)."""
    back = (np.maximum.accumulate(y) - y).max(), (y - np.minimum.accumulate(y)).max()
    return bool(min(back) > 2.0 * np.pi)


def _rests(yd: Array) -> bool:
    """Return True if a coordinate moves from rest to rest. Shape (n,)."""
    return bool(max(abs(yd[0]), abs(yd[-1])) <= REST * np.abs(yd).max())
