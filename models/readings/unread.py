"""What a file says and a reading of it does not hold, in words."""

from __future__ import annotations

from itertools import chain

from screwgauge.models.elements import beyond_reading
from screwgauge.models.readings.reading import Reading
from screwgauge.models.readings.source import Source
from screwgauge.reference.wording import first_few

#: Things of a kind that are named; the others are counted.
_NAMED = 3


def unread(source: Source, reading: Reading) -> tuple[str, ...]:
    """One phrase for each kind of element or attribute; links and joints that are not there at all come first."""
    found: dict[str, list[str]] = {}
    equal = [row for row in source.root.iterfind("equality/tendon") if row.get("name") in reading.couplings]
    coupling = {row.get(side) for row in equal for side in ("tendon1", "tendon2")}
    extras = (beyond_reading(root, source.form, reading.library) for root in (source.root, *source.attached.values()))
    for extra in chain.from_iterable(extras):
        if extra.what != "fixed tendon" or extra.whose.strip() not in coupling:
            found.setdefault(extra.what, []).append(extra.whose)
    said = [f"{what}{_whose(owners)}" for what, owners in found.items()]
    if source.form == "mjcf" and source.root.find("worldbody//geom") is not None:
        said.append("contacts of geoms")
    return (*dropped(source, reading), *source.ignored, *reading.ignored, *said)


def _whose(owners: list[str]) -> str:
    """`` of joint a, b, c and 9 more``, from `` of joint a``, `` of joint b`` ..."""
    owners = list(dict.fromkeys(owners))
    kind = " ".join(owners[0].split(" ")[:3]) if owners[0].startswith(" of ") else ""  # names may have spaces
    return first_few([owners[0], *(owner.removeprefix(f"{kind} ") for owner in owners[1:])], _NAMED)


def dropped(source: Source, reading: Reading) -> list[str]:
    """Links, moving joints and attached models of the file that the library has not made anything of."""
    fixed = (name for body in reading.bodies.values() for name in body.fixed)
    joints = {joint.removesuffix(end) for joint in reading.joints for end in ("", "_TX", "_TY", "_RZ")}
    said = (
        [f"attached models, which {reading.library} drops"] if source.attached and reading.library != "mujoco" else []
    )
    for what, known in (
        ("link" if source.form == "urdf" else "body", {*reading.bodies, *reading.fixed, *fixed}),
        ("joint", joints),
    ):
        names = [name for name in source.names(what) if name not in known]
        if names:
            said.append(f"{what} {first_few(names, _NAMED)}, which {reading.library} drops")
    return said
