"""What a file says and a reading of it does not hold."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from xml.etree import ElementTree as ET

from screwgauge.models.content import Content, Extra, Values, beyond_reading, kind_of
from screwgauge.models.readings.reading import Reading
from screwgauge.models.readings.source import Source
from screwgauge.reference.errors import first_few

#: Links and joints that are named; the others are counted.
_NAMED = 3


def unread(source: Source, reading: Reading) -> tuple[Content, ...]:
    """All of it; links and joints that are not there at all come first.

    Of an MJCF that MuJoCo has compiled nothing is looked for in the text: its arrays have all that it says.
    """
    known = source.form == "mjcf" and reading.library == "mujoco"
    roots = () if known else (source.root, *source.attached.values())
    extras = chain.from_iterable(beyond_reading(root, source.form, reading.library) for root in roots)
    said = [_content(source, extra) for extra in extras]
    if source.form == "mjcf" and source.root.find("worldbody//geom") is not None:
        said.append(Content("contacts of geoms", "contacts of geoms"))
    own = (each for each in reading.content if source.form == "mjcf" or each.kind != "force limits")
    return (*dropped(source, reading), *_prepared(source, reading), *own, *said)


def _content(source: Source, extra: Extra) -> Content:
    """With all that a URDF says of it, as classes of an MJCF add to what an element says."""
    kind = kind_of(extra.what)
    if source.form == "mjcf" or extra.element is None:
        return Content(kind, extra.what, extra.whose)
    joint = extra.whose.removeprefix(" of joint ")
    of = (("joints", joint, 1.0),) if joint != extra.whose else ()
    said = extra.element.get(extra.attribute) if extra.attribute else None
    values: Values = tuple(_canonical(extra.element)) if said is None else ((extra.attribute, _number(said)),)
    if extra.what == "limit effort" and isinstance(effort := _number(said or ""), float):  # as MuJoCo keeps it
        values = ("actfrcrange[0]", -effort), ("actfrcrange[1]", effort)
    return Content(kind, extra.what, extra.whose, of, values)


def _canonical(element: ET.Element) -> Iterator[tuple[str, float | str]]:
    """Numbers and texts of an element with all that is in it, whatever is written around them."""
    yield "element", element.tag
    for name, value in sorted(element.attrib.items()):
        yield from ((name, _number(word)) for word in value.split())
    yield from ((element.tag, _number(word)) for word in (element.text or "").split())
    for child in element:
        yield from _canonical(child)


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _prepared(source: Source, reading: Reading) -> Iterator[Content]:
    """What was taken out before a library saw it; only MuJoCo would take masses from meshes."""
    for each in source.content:
        idle = each.kind == "mass from meshes" and reading.library != "mujoco"
        yield replace(each, kind="put in place") if idle else each


def dropped(source: Source, reading: Reading) -> list[Content]:
    """Links, moving joints and attached models of the file that the library has not made anything of."""
    fixed = (name for body in reading.bodies.values() for name in body.fixed)
    joints = {joint.removesuffix(end) for joint in reading.joints for end in ("", "_TX", "_TY", "_RZ")}
    lost = source.attached and reading.library != "mujoco"
    said = [f"attached models, which {reading.library} drops"] if lost else []
    for what, known in (
        ("link" if source.form == "urdf" else "body", {*reading.bodies, *reading.fixed, *fixed}),
        ("joint", joints),
    ):
        names = [name for name in source.names(what) if name not in known]
        if names:
            said.append(f"{what} {first_few(names, _NAMED)}, which {reading.library} drops")
    return [Content("dropped by the library", phrase) for phrase in said]
