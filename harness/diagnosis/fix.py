"""The fix: a copy of B's file with A's values, and the proof that this copy agrees with A when it is read."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from bisect import bisect
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from screwgauge.diagnosis.explanation import Explanation, compare_pair, compare_readings, explain
from screwgauge.diagnosis.facts.fact import EXACT, Fact, numbers_in, select
from screwgauge.diagnosis.machine.alignment import Names
from screwgauge.diagnosis.machine.pair import Pair
from screwgauge.diagnosis.model import Model, Read
from screwgauge.diagnosis.patch import change_file
from screwgauge.diagnosis.properties import OPTIONAL, Change, apply_changes, sequence
from screwgauge.models.content import FORMATS
from screwgauge.models.formats import number_text
from screwgauge.models.kinematics import rehome
from screwgauge.models.mjcf import LEAST
from screwgauge.models.poses import matrix
from screwgauge.models.readings.reading import Reading
from screwgauge.models.readings.source import prepare
from screwgauge.reference.errors import OutputError, ScrewgaugeError
from screwgauge.reference.files import is_file, read_file
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.outputs import save_file
from screwgauge.reference.rotations import Array

#: Pattern of elements that make an MJCF include or attach a file.
_NAMED = r"<(include|model)\s[^>]*file\s*=\s*[\"']([^\"']*)[\"']"
#: Rounding error of a computed number, relative to the largest entry.
DUST = 1e-15
#: Largest gap of a closure that counts as closed at the home pose [m].
DERIVED = 1e-9
ONE_FILE = "A and B are the same file, which two libraries read differently"
NO_FILE = "B has no URDF or MJCF file to change"

T = TypeVar("T")


@dataclass(frozen=True, slots=True, eq=False)
class Fix:
    """A copy of B's file that agrees with A.

    Attributes:
        text: Text of the file; empty if nothing can be written.
        left: Facts that remain after reading the corrected file; None if it was not read.
        why_not: Reasons why changes are missing, as sentences.
        unheard: Properties in the file that B's library ignores.
        open: Differences of B from A that no change of a value corrects.
    """

    text: str
    left: tuple[Fact, ...] | None = None
    why_not: tuple[str, ...] = ()
    unheard: tuple[str, ...] = ()
    open: tuple[Fact, ...] = ()

    @property
    def proved(self) -> bool:
        """True if the corrected file was read and no difference remains."""
        return self.left is not None and not self.left


def make_fix(a: Model, b: Model, pair: Pair, load: Read, *, moved: bool = False, only: str = "") -> Fix:
    """Write a copy of B that agrees with A, and read that copy to prove it.

    Args:
        pair: A and B with their matching.
        moved: True if the pair contains B after it was aligned with A as a whole.
        only: The only group of properties to compare; empty for all.
    """
    if b.file is None or not b.text:
        form = b.reading.form.upper()
        return Fix("", why_not=(f"B is {form}; only URDF and MJCF can be changed" if form else NO_FILE,))
    if a.file == b.file:
        return Fix("", why_not=(ONE_FILE,))
    back = _compare_back(a, b, pair, moved=moved)
    facts = select(back.facts, only)
    changes = _to_pose_of_file(sequence(facts), b.reading, back.pair.a.reading)
    open_ = tuple(fact for fact in facts if not fact.changes)
    if not changes:
        return Fix("", open=open_)
    spell = make_speller(a.text)
    text, best = b.text, Fix("", open=open_)
    for plain in (False, True):
        changed, unwritten = change_file(text, b.reading, changes, plain=plain, spell=spell)
        why = tuple(dict.fromkeys(reason for _, reason in unwritten))
        if len(unwritten) == len(changes):
            return replace(best, why_not=why)
        try:
            again = reread(b.file, changed, lambda file: b.read_again(file, load))
        except ScrewgaugeError as error:
            best = replace(best, why_not=(*why, f"the changed file cannot be read: {error.what}"))
            continue
        joints = {name: partner.name for name, partner in pair.joints.items() if partner.name in again.joints}
        names = Names(joints, _bodies(pair), {})
        left = select(explain(a.posed, rehome(again, b.home)[0], names).facts, only)
        left = tuple(fact for fact in left if fact.what != "name")
        lost = {(change.item, change.what) for change, _ in unwritten}
        deaf = [f.what for f in left if f.what in OPTIONAL and (f.partner or f.part, f.what) not in lost]
        best = Fix(changed, left, why, tuple(dict.fromkeys(deaf)), open_)
        if best.proved:
            break
    return best


def _compare_back(a: Model, b: Model, pair: Pair, *, moved: bool) -> Explanation:
    """Compare A with B as it is, which yields changes that give B the values of A."""
    if not moved:
        return compare_pair(pair.inverse)
    bodies = {other: name for name, other in _bodies(pair).items()}
    return compare_readings(b.posed, a.posed, Names(pair.back, bodies, {}))


def _bodies(pair: Pair) -> dict[str, str]:
    """Return the partners of A's bodies, without the ground."""
    return {name: other for name, other in pair.bodies.items() if name != GROUND}


def _to_pose_of_file(changes: Iterable[Change], written: Reading, posed: Reading) -> list[Change]:
    """Convert changes from the pose of the comparison to the pose of the file."""
    q = {name: joint.home for name, joint in posed.joints.items() if written.joints[name].home != joint.home}
    _, before, after = rehome(written, q)
    at_home = [_convert(change, _carrier(change, written, before, after), written, posed) for change in changes]
    return [*at_home, *_derived_ends(apply_changes(written, at_home))]


def _carrier(change: Change, written: Reading, before: Mapping[str, Array], after: Mapping[str, Array]) -> Array:
    """Return the displacement of the changed joint's parent body, or of its child body for a change of ``seat``."""
    if change.what == "seat":
        return after[written.moved_by(change.item)]
    return before.get(change.item, np.eye(4))


def _derived_ends(target: Reading) -> Iterator[Change]:
    """Yield changes to second ends of closures that a file derives from the first ends."""
    for name, closure in target.closures.items():
        (_, one), (_, other) = target.ends(name)
        way = other[:3, :3].T @ (one - other)[:3, 3]
        if closure.derived and np.abs(way).max() > DERIVED:
            yield Change(name, "second_frame", closure.second_frame @ matrix(way, np.eye(3)))


def _convert(change: Change, X: Array, written: Reading, posed: Reading) -> Change:
    """Convert a change to the pose of the file; X, shape (4, 4), is the displacement of the changed joint's body."""
    value = change.value
    if change.what in ("placement", "seat"):
        value = np.linalg.inv(X) @ value @ X
    elif change.what == "axis":
        value = X[:3, :3].T @ value
    elif change.what == "centre":
        value = X[:3, :3].T @ (value - X[:3, 3])
    elif change.what == "zero":
        value = value + written.joints[change.item].home - posed.joints[change.item].home
    return replace(change, value=np.asarray(value))


def reread(file: Path, text: str, read: Callable[[Path], T]) -> T:
    """Read a copy of a file with different text, leaving the file itself unchanged.

    Raises:
        ScrewgaugeError: The text cannot be read.
    """
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        copy = Path(folder) / file.name
        _copy_parts(file.parent, Path(folder), text)
        copy.write_text(text, encoding="utf-8")
        return read(copy)


def _copy_parts(source: Path, folder: Path, text: str) -> None:
    """Copy the files in the MJCF's folder that it includes or attaches, recursively."""
    home, target = source.resolve(), folder.resolve()
    waiting = [(Path(), *named) for named in re.findall(_NAMED, text)]  # folder, element and name
    seen = set[Path]()
    while waiting:
        base, tag, name = waiting.pop()
        origin, copy = ((root / base / name).resolve() for root in (home, target))
        inside = origin.is_relative_to(home) and copy.is_relative_to(target)
        if copy in seen or not inside or not is_file(origin):
            continue
        seen.add(copy)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(origin, copy)
        # includes are relative to the main file, attached models to the file that attaches them
        base = base if tag == "include" else (base / name).parent
        waiting += [(base, *named) for named in re.findall(_NAMED, read_file(origin))]


def write_fix(out: Path, text: str, b: Path, inputs: Sequence[Path] = (), *, force: bool = False) -> None:
    """Write the corrected file; see `save_file`.

    Args:
        b: The user's file.
        inputs: Other files that were read.
        force: Replace an existing file.

    Raises:
        OutputError: The path is the path of B, has the suffix of a different format, is in use, or cannot be written.
    """
    if os.path.exists(out) and os.path.samefile(out, b):
        raise OutputError("is B itself, which is never overwritten", str(out), "choose another --fix")
    if out.suffix in FORMATS and out.suffix != b.suffix and (form := prepare(b).form) != FORMATS[out.suffix]:
        raise OutputError(f"ends with {out.suffix}, but B is {form.upper()}", str(out), "choose another --fix")
    save_file(out, text, inputs, force=force)


def make_speller(text: str) -> Callable[[str], str]:
    """Build a function that replaces computed numbers with nearly equal numbers from a file or with short decimals.

    Multiplying frames leaves rounding errors in the last digits, including tiny numbers in place of zeros.

    Args:
        text: Text of the file.

    Returns:
        A function that maps an attribute value, numeric or not, to the string to write.
    """
    numbers = sorted({*numbers_in(text)})
    nothing = min([DUST, *(1e-3 * abs(number) for number in numbers if number)]) if numbers else 0.0

    def spell(value: str) -> str:
        try:
            entries = [float(word) for word in value.split()]
        except ValueError:
            return value
        return " ".join(_spell_entries(entries, numbers, nothing))

    return spell


def _spell_entries(entries: Sequence[float], numbers: Sequence[float], nothing: float) -> Iterator[str]:
    most = max(map(abs, entries), default=0.0)
    for x in entries:
        if LEAST <= x <= np.nextafter(LEAST, 1.0):  # stands for a moment of zero
            yield number_text(x)
            continue
        k, off = bisect(numbers, x), DUST * (4.0 * abs(x) + most)
        near = [number for _, number in sorted((abs(one - x), one) for one in numbers[max(k - 1, 0) : k + 1])]
        near = [0.0] if abs(x) <= max(off, nothing) else [*near, float(f"{x:.{EXACT}g}")]
        yield number_text(next((number for number in near if abs(number - x) <= max(off, nothing)), x))
