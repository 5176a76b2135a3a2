"""Writes descriptions with a solved home pose, keeping the user's text where possible."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from textwrap import wrap
from typing import Any

from screwgauge.models.catalog import load_mechanism
from screwgauge.models.formats import key, value_text
from screwgauge.models.importing.model import Imported, description
from screwgauge.reference.files import is_path, read_file
from screwgauge.reference.rotations import Array

#: Patterns, for each way of writing a table, of the text before a joint's ``home`` entry or before the position where
#: that entry can be inserted; the first group is kept.
_HOME = r"[ \t]*\[[^\[\]]*\]"
_PLACES = (
    (rf"(^[ \t]*\[[ \t]*joints[ \t]*\.[ \t]*{{0}}[ \t]*\](?:(?!^[ \t]*\[).)*?^[ \t]*home[ \t]*=){_HOME}", " {}"),
    (r"(^[ \t]*\[[ \t]*joints[ \t]*\.[ \t]*{0}[ \t]*\][^\n]*\n)", "home = {}\n"),
    (rf"(^[ \t]*(?:joints\.)?{{0}}[ \t]*=[ \t]*\{{{{[^\n]*?\bhome[ \t]*=){_HOME}", " {}"),
    (r"(^[ \t]*(?:joints\.)?{0}[ \t]*=[ \t]*\{{)", " home = {},"),
    (rf"(^[ \t]*(?:joints\.)?{{0}}\.home[ \t]*=){_HOME}", " {}"),
)


def import_description(path: Path) -> tuple[Imported, str]:
    """Load a description with a home pose that closes its loops; return the mechanism and its text.

    Raises:
        ScrewgaugeError: The file is not a description, or its loops do not close at any pose.
    """
    mechanism, written = load_mechanism(path), load_mechanism(path, closed=False)
    pairs = zip(mechanism.joints, written.joints, strict=True)
    homes = {joint.name: joint.home for joint, old in pairs if (joint.home != old.home).any()}
    remarks = tuple(f"{remark[0].upper()}{remark[1:]}." for remark in mechanism.remarks)
    text = with_homes(path, homes)
    if text is None:
        remarks = (*remarks, f"The description is rewritten: the text of {path.name} could not be kept.")
        text = description(mechanism, remarks)
    else:
        text = "\n".join([*(f"# {line}" for remark in remarks for line in wrap(remark, 116)), text])
    remarks = remarks or (f"The loops of {path.name} close at the home pose as written.",)
    return Imported(mechanism, (), None, {}, remarks, ()), text


def with_homes(path: Path, homes: dict[str, Array]) -> str | None:
    """Replace the home values of joints in the text of a description; return None if the text cannot be kept."""
    text = read_file(path)
    tables = tomllib.loads(text)
    if is_path(str(tables.get("extends", ""))):  # the relative path may not be valid in a different folder
        return None
    wanted = deepcopy(tables)
    for name, home in homes.items():
        wanted.setdefault("joints", {}).setdefault(name, {})["home"] = home.tolist()
        texts = (each for each in _texts(text, name, value_text(home)) if _parse(each) == wanted)
        if (changed := next(texts, None)) is None:
            return None
        text = changed
    return text


def _texts(text: str, name: str, home: str) -> Iterator[str]:
    """Yield versions of the text with a joint's home entry at each possible place; the last version adds a table."""
    quoted = rf"(?:\"{re.escape(name)}\"|'{re.escape(name)}'|{re.escape(name)})"
    for place, new in _PLACES:
        for match in re.finditer(place.format(quoted), text, re.MULTILINE | re.DOTALL):
            yield text[: match.end(1)] + new.format(home) + text[match.end() :]
    yield f"{text.rstrip()}\n\n[joints.{key(name)}]\nhome = {home}\n"


def _parse(text: str) -> Any:
    try:
        return tomllib.loads(text)
    except ValueError:
        return None
