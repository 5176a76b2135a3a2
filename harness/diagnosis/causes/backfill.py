"""Proof of a cause: B's own file with the change made is read again by B's own library, and has to agree with A."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np

from screwgauge.diagnosis.causes.attribution import ROUNDING, Largest, Torques, largest
from screwgauge.diagnosis.differences.difference import speller
from screwgauge.diagnosis.notes import unheard
from screwgauge.diagnosis.patch import patched
from screwgauge.diagnosis.properties import INERTIAL, OPTIONAL, PASSIVE, PROPERTIES, ROOMS, Change, applied
from screwgauge.models.content import FORMATS
from screwgauge.models.readings.reading import Reading
from screwgauge.models.readings.source import prepare
from screwgauge.reference.errors import OutputError, ScrewgaugeError
from screwgauge.reference.files import is_file, read_file, replace_file, stamped

#: A file that is read again leaves at most so much, scaled: numbers of 17 digits, MuJoCo's principal axes.
RELOADED = 10 * ROUNDING
#: Properties that a file holds in the same numbers, wherever its loops are cut; why others are not written.
KEPT = {*INERTIAL, *OPTIONAL, "limits"}
RECUT = "loops of B are cut elsewhere than in its file, in other numbers"
#: Files that an MJCF includes or attaches.
_NAMED = r"<(include|model)\s[^>]*file\s*=\s*[\"']([^\"']*)[\"']"

T = TypeVar("T")


@dataclass(frozen=True, slots=True, eq=False)
class Backfill:
    """What the proof gave.

    Attributes:
        on: ``file`` if the change was made in B's file, ``reading`` if in what was read from it.
        why_not: Why not, or not all of it, in the file; a sentence each.
        left: Largest torque difference that is left.
        text: The file with the changes; empty if none could be made in it, or none is read from it.
        unheard: Changes that are in the file and that B's library ignores; they are made in what it reads.
    """

    on: Literal["file", "reading"]
    why_not: tuple[str, ...]
    left: Largest
    text: str
    unheard: tuple[Change, ...] = ()

    @property
    def agrees(self) -> bool:
        """Whether rounding is all that is left."""
        return self.left.scaled <= RELOADED


def backfill(
    torques: Torques,
    b: Reading,
    changes: Sequence[Change],
    file: Path | None,
    read: Callable[[Path], Reading],
    written: Reading | None = None,
    pattern: str = "",
) -> Backfill:
    """Makes changes in a copy of B's file, or, where that cannot be, in its reading.

    Args:
        file: B's, if it has one.
        read: B's library; loops are cut as in `b` again.
        written: Reading of the file, where loops of `b` are cut elsewhere; `b` by default.
        pattern: Text of A's file, which has the numbers that are written.
    """
    on_reading = largest(torques, torques.left(applied(b, changes)))
    if file is None:
        return Backfill("reading", ("B has no file of a format that is changed here",), on_reading, "")
    why, best, stated = list[str](), Backfill("reading", (), on_reading, ""), written or b
    elsewhere = tuple((change, RECUT) for change in changes if stated is not b and not _stands(change, b, stated))
    here = [change for change in changes if all(change is not other for other, _ in elsewhere)]
    spell = speller(pattern)
    for plain in (False, True):
        patch = patched(read_file(file), stated, here, plain=plain, spell=spell)
        patch = replace(patch, left=(*elsewhere, *patch.left))
        why = list(dict.fromkeys(reason for _, reason in patch.left))
        done = [change for change in changes if all(change is not other for other, _ in patch.left)]
        if not done:
            break
        try:
            again = reread(file, patch.text, read)
        except ScrewgaugeError as error:
            why.append(f"the changed file cannot be read: {error.what}")
            continue
        deaf = tuple(change for change in done if unheard(change, b, again))
        why += dict.fromkeys(f"{b.library} reads no {change.what} from the file" for change in deaf)
        if len(deaf) == len(done):
            return Backfill("reading", tuple(why), on_reading, "", deaf)
        left = largest(torques, torques.left(applied(again, [*(change for change, _ in patch.left), *deaf])))
        if best.on == "reading" or left.scaled < best.left.scaled:
            best = Backfill("file", tuple(why), left, patch.text, deaf)
        if best.agrees:
            return best
    return best if best.on == "file" else Backfill("reading", tuple(why), on_reading, "")


def _stands(change: Change, b: Reading, written: Reading) -> bool:
    """Whether a file has the part and the value that a change is of where loops are cut as in the file, too."""
    owner, what = PROPERTIES[change.what].owner, change.what
    if what not in KEPT:
        return False
    if owner == "model":
        return np.array_equal(np.asarray(getattr(b, what)), np.asarray(getattr(written, what)))
    if change.item not in getattr(written, ROOMS[owner]):
        return False
    parts = (getattr(each, ROOMS[owner])[change.item] for each in (b, written))
    return all(np.allclose(x, y, rtol=1e-12, atol=1e-15) for x, y in zip(*map(_kept, parts), strict=True))


def _kept(part: Any) -> list[Any]:
    """Values of a body or joint that do not depend on where loops are cut, as long as it is the same one."""
    names = (*INERTIAL, "gravcomp") if hasattr(part, "mass") else ("home", "limits", *PASSIVE, "rest")
    return [getattr(part, name) for name in names]


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


def write_fix(out: Path, text: str, b: Path, own: Path | None = None) -> None:
    """Writes the changed file, whole or not at all.

    Args:
        own: The user's file, where B is a copy of it.

    Raises:
        OutputError: It is B's own, has the ending of another format, or cannot be written.
    """
    if os.path.exists(out) and os.path.samefile(out, own or b):
        raise OutputError("is B itself, which is never overwritten", str(out), "choose another --fix")
    if os.path.isdir(out):
        raise OutputError("is a folder", str(out), "name a file")
    if out.suffix in FORMATS and out.suffix != b.suffix and (form := prepare(b).form) != FORMATS[out.suffix]:
        raise OutputError(
            f"ends with {out.suffix}, and B is a file of {form.upper()}", str(out), "choose another --fix"
        )
    with suppress(OSError):  # which `replace_file` then meets, too
        out.parent.mkdir(parents=True, exist_ok=True)
    replace_file(out, stamped(text))
