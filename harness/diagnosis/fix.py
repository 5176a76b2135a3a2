"""The fix: facts read from B to A are what B's file has to say; the proof is that nothing differs once it is read."""

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

from screwgauge.diagnosis.explanation import Explanation, compared, explained, of_pair
from screwgauge.diagnosis.facts.fact import EXACT, Fact, Pair, among, numbers_in
from screwgauge.diagnosis.machine.alignment import Names
from screwgauge.diagnosis.model import Model, Read
from screwgauge.diagnosis.patch import patched
from screwgauge.diagnosis.properties import OPTIONAL, Change, applied, sequence
from screwgauge.models.content import FORMATS
from screwgauge.models.formats import number_text
from screwgauge.models.kinematics import rehomed
from screwgauge.models.mjcf import LEAST
from screwgauge.models.poses import matrix
from screwgauge.models.readings.reading import Reading
from screwgauge.models.readings.source import prepare
from screwgauge.reference.errors import OutputError, ScrewgaugeError
from screwgauge.reference.files import is_file, read_file
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.outputs import save_file
from screwgauge.reference.rotations import Array

#: Files that an MJCF includes or attaches.
_NAMED = r"<(include|model)\s[^>]*file\s*=\s*[\"']([^\"']*)[\"']"
#: Rounding of a computed number, relative to the largest entry.
DUST = 1e-15
#: Ends of a closure that are further apart at home do not meet [m].
DERIVED = 1e-9
ONE_FILE = "A and B are one file, which two libraries read differently"
NO_FILE = "B has no file of a format that is changed here"

T = TypeVar("T")


@dataclass(frozen=True, slots=True, eq=False)
class Fix:
    """A copy of B's file that agrees with A.

    Attributes:
        text: The file; empty where nothing can be written.
        left: Facts that still differ when it is read again; None where it was not read.
        why_not: Why something is not in it, a sentence each.
        unheard: Properties that are in the file and that B's library does not read.
        open: Facts of B against A that no value mends.
    """

    text: str
    left: tuple[Fact, ...] | None = None
    why_not: tuple[str, ...] = ()
    unheard: tuple[str, ...] = ()
    open: tuple[Fact, ...] = ()

    @property
    def proved(self) -> bool:
        """Whether nothing differs any more."""
        return self.left is not None and not self.left


def fixed(a: Model, b: Model, pair: Pair, load: Read, *, moved: bool = False, only: str = "") -> Fix:
    """Write B as it would have to be to agree with A, and read it again.

    Args:
        pair: A and B with their partners.
        moved: Whether B of the pair was laid onto A as a whole.
        only: What alone is compared; empty for all.
    """
    if b.file is None or not b.text:
        form = b.reading.form.upper()
        return Fix("", why_not=(f"B is {form}, which is not changed here, as URDF and MJCF are" if form else NO_FILE,))
    if a.file == b.file:
        return Fix("", why_not=(ONE_FILE,))
    back = _backwards(a, b, pair, moved=moved)
    facts = among(back.facts, only)
    changes = _as_written(sequence(facts), b.reading, back.pair.a.reading)
    open_ = tuple(fact for fact in facts if not fact.changes)
    if not changes:
        return Fix("", open=open_)
    spell = speller(a.text)
    text, best = b.text, Fix("", open=open_)
    for plain in (False, True):
        patch = patched(text, b.reading, changes, plain=plain, spell=spell)
        why = tuple(dict.fromkeys(reason for _, reason in patch.left))
        if len(patch.left) == len(changes):
            return replace(best, why_not=why)
        try:
            again = reread(b.file, patch.text, lambda file: b.read_again(file, load))
        except ScrewgaugeError as error:
            best = replace(best, why_not=(*why, f"the changed file cannot be read: {error.what}"))
            continue
        left = among(explained(a.posed, rehomed(again, b.home)[0], _names(pair, again)).facts, only)
        left = tuple(fact for fact in left if fact.what != "name")
        lost = {(change.item, change.what) for change, _ in patch.left}
        deaf = [f.what for f in left if f.what in OPTIONAL and (f.partner or f.part, f.what) not in lost]
        best = Fix(patch.text, left, why, tuple(dict.fromkeys(deaf)), open_)
        if best.proved:
            break
    return best


def _backwards(a: Model, b: Model, pair: Pair, *, moved: bool) -> Explanation:
    """B against A as it stands: facts of which each change gives B the value of A."""
    if not moved:
        return of_pair(pair.inverse)
    bodies = {other: name for name, other in _bodies(pair).items()}
    return compared(b.posed, a.posed, Names(pair.back, bodies, {}))


def _names(pair: Pair, again: Reading) -> Names:
    joints = {name: partner.name for name, partner in pair.joints.items() if partner.name in again.joints}
    return Names(joints, _bodies(pair), {})


def _bodies(pair: Pair) -> dict[str, str]:
    """Bodies of A with those of B, without the ground."""
    return {name: other for name, other in pair.alignment.bodies.items() if name != GROUND}


def _as_written(changes: Iterable[Change], written: Reading, posed: Reading) -> list[Change]:
    """Changes in the pose of the file, where they are known in another one."""
    q = {name: joint.home for name, joint in posed.joints.items() if written.joints[name].home != joint.home}
    _, before, after = rehomed(written, q)
    at_home = [_at_home(change, _carrier(change, written, before, after), written, posed) for change in changes]
    return [*at_home, *_derived(applied(written, at_home))]


def _carrier(change: Change, written: Reading, before: Mapping[str, Array], after: Mapping[str, Array]) -> Array:
    """How the body is displaced that a change of a joint is on: the one before it, or that which is seated on it."""
    if change.what == "seat":
        return after[written.moved_by(change.item)]
    return before.get(change.item, np.eye(4))


def _derived(target: Reading) -> Iterator[Change]:
    """Second ends of closures that a file derives from the first ones, where the bodies are now."""
    for name, closure in target.closures.items():
        (_, one), (_, other) = target.ends(name)
        way = other[:3, :3].T @ (one - other)[:3, 3]
        if closure.derived and np.abs(way).max() > DERIVED:
            yield Change(name, "second_frame", closure.second_frame @ matrix(way, np.eye(3)))


def _at_home(change: Change, X: Array, written: Reading, posed: Reading) -> Change:
    """A change of a joint on a body that is displaced by X, shape (4, 4), from the pose of the file."""
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
    """What is read from a file if its text is another one; the file stays as it is.

    Raises:
        ScrewgaugeError: The text cannot be read.
    """
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        copy = Path(folder) / file.name
        _bring(file.parent, Path(folder), text)
        copy.write_text(text, encoding="utf-8")
        return read(copy)


def _bring(source: Path, folder: Path, text: str) -> None:
    """Copies what an MJCF includes or attaches, and what that does, if it lies in the folder of the file."""
    home, target = source.resolve(), folder.resolve()
    waiting = [(Path(), *named) for named in re.findall(_NAMED, text)]  # looked for where, by which element, its name
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
        # includes are relative to the whole file, attached models to the one that attaches them
        base = base if tag == "include" else (base / name).parent
        waiting += [(base, *named) for named in re.findall(_NAMED, read_file(origin))]


def write_fix(out: Path, text: str, b: Path, inputs: Sequence[Path] = (), *, force: bool = False) -> None:
    """Write the changed file, see `save_file`.

    Args:
        b: The user's file.
        inputs: What else was read.
        force: Any other file in the way is replaced.

    Raises:
        OutputError: It is B's own, has the ending of another format, is in the way, or cannot be written.
    """
    if os.path.exists(out) and os.path.samefile(out, b):
        raise OutputError("is B itself, which is never overwritten", str(out), "choose another --fix")
    if out.suffix in FORMATS and out.suffix != b.suffix and (form := prepare(b).form) != FORMATS[out.suffix]:
        raise OutputError(
            f"ends with {out.suffix}, and B is a file of {form.upper()}", str(out), "choose another --fix"
        )
    save_file(out, text, inputs, force=force)


def speller(text: str) -> Callable[[str], str]:
    """Prints computed numbers as the numbers of a file, else as the decimals of `EXACT` digits, that they nearly are.

    Products of frames leave rounding in the last digits, and next to larger entries of a vector in place of a zero.

    Args:
        text: Of the file.

    Returns:
        The value of an attribute, of numbers or not -> the same as it is to be written.
    """
    numbers = sorted({*numbers_in(text)})
    nothing = min([DUST, *(1e-3 * abs(number) for number in numbers if number)]) if numbers else 0.0

    def spell(value: str) -> str:
        try:
            entries = [float(word) for word in value.split()]
        except ValueError:
            return value
        return " ".join(_spelled(entries, numbers, nothing))

    return spell


def _spelled(entries: Sequence[float], numbers: Sequence[float], nothing: float) -> Iterator[str]:
    most = max(map(abs, entries), default=0.0)
    for x in entries:
        if LEAST <= x <= np.nextafter(LEAST, 1.0):  # written in place of a moment of zero
            yield number_text(x)
            continue
        k, off = bisect(numbers, x), DUST * (4.0 * abs(x) + most)
        near = [number for _, number in sorted((abs(one - x), one) for one in numbers[max(k - 1, 0) : k + 1])]
        near = [0.0] if abs(x) <= max(off, nothing) else [*near, float(f"{x:.{EXACT}g}")]
        yield number_text(next((number for number in near if abs(number - x) <= max(off, nothing)), x))
