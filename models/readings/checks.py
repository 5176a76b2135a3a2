"""What is refused in a URDF or MJCF before a library reads it: libraries let it pass, or say little."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from xml.etree import ElementTree as ET

from screwgauge.reference.errors import ModelFileError, UnknownNameError

#: What makes bodies of an MJCF without naming them.
MAKERS = ("replicate", "composite", "flexcomp")
#: Attributes that hold no numbers, though what they hold may look like one.
_TEXT = ("name", "link", "class", "childclass", "filename", "file", "model")
#: Attributes that may be infinite: limits.
_UNLIMITED = re.compile("lower|upper|effort|velocity|.*range")
_NAN, _INFINITE = re.compile(r"[+-]?nan(\(.*\))?"), re.compile("[+-]?inf(inity)?")


def check_numbers(root: ET.Element, where: str) -> None:
    """Refuses what is not a number, and what is infinite but for limits.

    Raises:
        ModelFileError: There is such an attribute.
    """
    for element in root.iter():
        for attribute, value in element.items():
            words = value.lower().split() if attribute not in _TEXT else []
            bad = any(map(_NAN.fullmatch, words))
            if bad or (any(map(_INFINITE.fullmatch, words)) and not _UNLIMITED.fullmatch(attribute)):
                what = f"{_said(element, attribute)} is not a finite number ({value})"
                raise ModelFileError(what, where, "write one")


def number(element: ET.Element, attribute: str, default: float, where: str) -> float:
    """A number, or what counts where there is none.

    Raises:
        ModelFileError: It is something else.
    """
    value = element.get(attribute)
    try:
        return default if value is None else float(value)
    except ValueError:
        raise ModelFileError(f"{_said(element, attribute)} is no number ({value})", where, "write one") from None


def _said(element: ET.Element, attribute: str) -> str:
    return f"{attribute} of {element.tag} {element.get('name', '')}".rstrip()


def world(root: ET.Element) -> Iterator[ET.Element]:
    """All elements below the world bodies of an MJCF."""
    for body in root.iterfind("worldbody"):
        yield from body.iter()


def check_names(root: ET.Element, form: str, where: str) -> None:
    """Refuses names that two links or two joints share, of which most libraries keep one in silence.

    Raises:
        ModelFileError: There are such names, or there is no link or body at all, or one without a name.
    """
    kinds: dict[str, tuple[str, ...]] = {"body": ("body",), "joint": ("joint", "freejoint")}
    if form == "urdf":
        kinds = {"link": ("link",), "joint": ("joint",)}
    places = list(root) if form == "urdf" else list(world(root))
    for what, tags in kinds.items():
        names = Counter(element.get("name") for element in places if element.tag in tags)
        if what != "joint" and not names and not any(place.tag in (*MAKERS, "attach") for place in places):
            raise ModelFileError(f"has no {what}", where, "give the file that describes the robot")
        for name, count in names.items():
            if not name:
                raise ModelFileError(f"a {what} has no name", where, "give it one")
            if count > 1:
                said = f"'{name}' is the name of {count} {tags[0]} elements"
                raise ModelFileError(said, where, "give each a name of its own")


def check_tree(root: ET.Element, where: str) -> None:
    """Refuses a URDF whose joints do not make a tree of all its links.

    Raises:
        ModelFileError: A joint has no parent or child, a link hangs on two joints, or several or none on no joint.
        UnknownNameError: A joint joins a link, or mimics a joint, that is not there.
    """
    links = [link.get("name", "") for link in root.iterfind("link")]
    joints = [joint.get("name", "") for joint in root.iterfind("joint")]
    known, hung = {*links}, set[str]()
    for joint in root.iterfind("joint"):
        for side in ("parent", "child"):
            end = joint.find(side)
            if end is None or not end.get("link"):
                raise ModelFileError(f"joint {joint.get('name')} has no {side}", where, "name that link")
            if end.get("link") not in known:
                raise UnknownNameError("link", end.get("link"), links, f"{where}, joint {joint.get('name')}")
        child = carried_link(joint)
        if child in hung:
            remedy = "cut the loop open and say it in a loops file beside the URDF"
            raise ModelFileError(f"link {child} hangs on two joints", where, remedy)
        hung.add(child)
        leads = joint.find("mimic")
        if leads is not None and leads.get("joint") not in joints:
            raise UnknownNameError("joint", leads.get("joint"), joints, f"{where}, mimic of {joint.get('name')}")
    free = [name for name in links if name not in hung]
    if len(free) != 1:
        what = f"{len(free)} links hang on no joint ({', '.join(free[:3])})" if free else "every link hangs on a joint"
        raise ModelFileError(what, where, "let exactly one be the root")


def carried_link(joint: ET.Element) -> str:
    """Name of the link that a joint of a URDF carries."""
    child = joint.find("child")
    return "" if child is None else child.get("link", "")


def root_link(root: ET.Element) -> str:
    """Name of the link of a URDF that hangs on no joint."""
    children = {carried_link(joint) for joint in root.iterfind("joint")}
    return next((link.get("name", "") for link in root.iterfind("link") if link.get("name") not in children), "")
