"""Examples of all sentences of a diagnosis: ``python tests/golden/told.py`` writes ``told.txt``."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from screwgauge.diagnosis.answer import phrase
from screwgauge.diagnosis.causes.causes import Cause
from screwgauge.diagnosis.causes.reasons import Reason
from screwgauge.diagnosis.facts.fact import Fact
from screwgauge.diagnosis.machine.whole import Whole
from screwgauge.diagnosis.model import load_side
from screwgauge.diagnosis.words import Speaker
from screwgauge.models.machine import machine_of

FILE = Path(__file__).with_name("told.txt")
MACHINE = machine_of(load_side("arm7").reading)
JOINTS, BODIES = [*MACHINE.reading.joints], [*MACHINE.reading.bodies]
J, K, L, BODY = *JOINTS[:3], BODIES[1]
TURN = np.array([[0.0, 0.0, 0.1], [0.0, 0.0, 0.0]])
STEP = np.array([[0.01, 0.02, 0.1], [0.001, 0.0, 0.02]])
INERTIA = np.diag([0.02, 0.03, 0.04])
EXTRA = INERTIA + 0.001 * (np.ones((3, 3)) - np.eye(3))


def value(part: str, what: str, a: object, b: object, unit: str = "", **more: object) -> Fact:
    first, second = (None if x is None else np.asarray(x, float) for x in (a, b))
    return Fact(part, what, first, second, unit, 0.01, **more)  # type: ignore[arg-type]


def turned(angle: float) -> np.ndarray:
    """A placement that turns about z. Shape (4, 4)."""
    T = np.eye(4)
    T[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    return T


FACTS: Mapping[str, Fact] = {
    "mass": value(BODY, "mass", 2.0, 3.0, "kg"),
    "mass by a little": value(BODY, "mass", 2.0, 2.00001, "kg"),
    "mass by a large factor": value(BODY, "mass", 2.0, 2000.0, "kg"),
    "mass of the other sign": value(BODY, "mass", 2.0, -2.0, "kg"),
    "mass of one side": value(BODY, "mass", 0.0, 2.0, "kg"),
    "com along an axis": value(BODY, "com", [0.1, 0.0, 0.2], [0.1, 0.0, 0.25], "m"),
    "com": value(BODY, "com", [0.1, 0.0, 0.2], [0.15, 0.1, 0.25], "m"),
    "inertia": value(BODY, "inertia", INERTIA, 2.0 * INERTIA, "kg m^2"),
    "inertia, one entry": value(BODY, "inertia", INERTIA, INERTIA + np.diag([0.0, 0.0, 0.01]), "kg m^2"),
    "inertia, other axes": value(BODY, "inertia", INERTIA, INERTIA[::-1, ::-1], "kg m^2"),
    "inertia, several entries": value(BODY, "inertia", INERTIA, EXTRA, "kg m^2"),
    "gravcomp": value(BODY, "gravcomp", 0.0, 1.0),
    "armature": value(J, "armature", 0.1, 0.2, "kg m^2"),
    "damping": value(J, "damping", 0.1, 0.0, "N m s/rad"),
    "friction": value(J, "friction", 0.1, 0.2, "N m"),
    "stiffness": value(J, "stiffness", 5.0, 10.0, "N m/rad"),
    "rest": value(J, "rest", 0.0, 0.5, "rad"),
    "limits": value(J, "limits", [-2.0, 2.0], [-1.0, 2.0], "rad"),
    "limits of one side": value(J, "limits", [-2.0, 2.0], None, "rad"),
    "limits from another zero": value(J, "limits", [-2.0, 2.0], [-3.0, 1.0], "rad", kind="convention"),
    "sign": Fact(J, "sign", 1.0, -1.0, kind="convention"),
    "zero of a hinge": Fact(J, "zero", 0.0, math.pi, "rad", kind="convention"),
    "zero of a slide": Fact(J, "zero", 0.0, 0.05, "m", kind="convention"),
    "placement along an axis": Fact(J, "placement", 0.0 * TURN, TURN, "m", of=BODY),
    "placement": Fact(K, "placement", 0.0 * STEP, STEP, "m", of=BODY),
    "axis": Fact(J, "axis", 0.0 * TURN, TURN, "m", of=BODY),
    "end on a body": Fact("loop", "end", 0.0 * STEP, STEP[:] * [[0.0], [1.0]], "m", of=BODY),
    "end on both": Fact("loop", "end", 0.0 * STEP, STEP[:] * [[0.0], [1.0]], "m"),
    "name": Fact(J, "name", J, K, kind="convention", partner=K),
    "start": Fact("pelvis", "start", 0.0 * TURN, TURN, "m", kind="convention"),
    "kind": Fact(J, "kind", "R", "P"),
    "kind of several freedoms": Fact(f"{J}/{K}", "kind", "U", "PR", kind="convention"),
    "base": Fact("pelvis", "base", ("slide", "slide", "slide", "ball"), ("free",), kind="convention"),
    "fixed": Fact(J, "fixed", "hinge", None),
    "branch": Fact(J, "branch", "R", None, of="2.5", more=(BODY, "hand", "finger", "thumb")),
    "link": Fact("loop", "link", "R", None),
    "weld": Fact("w", "link", None, "weld"),
    "fixed elsewhere": Fact(J, "fixed", "hinge", None, of="0.5 rad"),
    "link with its body": Fact(J, "link", "R", None, of="2.5", more=(BODY,)),
    "held": value(J, "held", None, 0.2, "rad"),
    "coupling": Fact(J, "coupling", K, None),
    "polynomial": value(J, "polynomial", [0.0, 1.0], [0.1, 1.5], of=K),
    "polynomial of a held joint": value(J, "polynomial", [0.2], [0.3]),
    "leading joint": value(J, "leading joint", [0.0, 1.0], [0.2, 0.0], of=K, more=(K, "")),
    "softness": value("loop", "softness", [0.02, 1.0], [0.01, 1.0]),
    "actuator": value("motor", "actuator", 1.0, None, of=J),
    "driven joint": Fact("motor", "driven joint", J, K, of=J),
    "gear": value("motor", "gear", 100.0, 50.0, of=J),
    "gear of the other sign": value("motor", "gear", 100.0, -100.0, of=J, kind="convention"),
    "gravity": value("", "gravity", [0.0, 0.0, -9.81], [0.0, 0.0, 9.81], "m/s^2"),
    "density": value("", "density", 0.0, 1000.0, "kg/m^3"),
    "viscosity": value("", "viscosity", 0.001, 0.002, "Pa s"),
    "whole, elsewhere": Fact("", "whole", None, Whole(turned(0.5))),
    "whole, about the first joint": Fact("", "whole", None, Whole(turned(math.pi)), kind="convention", of=J),
    "whole, mirrored": Fact("", "whole", None, Whole(np.diag([1.0, -1.0, 1.0, 1.0]))),
    "whole, in other units": Fact("", "whole", None, Whole(length=1000.0, mass=1000.0, inertia=1e9)),
    "content": Fact(
        "t", "fixed tendons", {"coefficient of a": 1.0, "x": "p"}, {"coefficient of a": 0.5, "x": "q"}, of="tendon t"
    ),
    "content of one side": Fact("t", "fixed tendons", None, {}, of="tendon t"),
    "content of other lengths": Fact("t", "fixed tendons", {}, {}, of="tendon t"),
}

MASSES = tuple(value(part, "mass", 2.0, 3.0, "kg") for part in BODIES[:4])
WEIGHTS = tuple(
    value(part, what, x, 1.5 * x, unit)
    for part in BODIES[:3]
    for what, x, unit in (("mass", 2.0, "kg"), ("inertia", INERTIA, "kg m^2"))
)
DAMPING = tuple(value(part, "damping", 0.0, 0.5, "N m s/rad") for part in JOINTS)
UNLIKE = tuple(value(part, "friction", 0.1 * i, 0.0, "N m") for i, part in enumerate(JOINTS[:4], 1))
LIMITS = tuple(value(part, "limits", None, [-2.0, 2.0], "rad") for part in JOINTS[:3])
TENDONS = tuple(Fact(name, "fixed tendons", {}, None, of=f"tendon {name}") for name in "abc")
ROTORS = (FACTS["armature"], FACTS["gear"])
BODY_FACTS = (FACTS["mass"], FACTS["com"], FACTS["inertia"])

CAUSES: Mapping[str, Cause] = {
    "several properties of a body": Cause((BODY_FACTS,), 0.5),
    "one factor of many": Cause((MASSES,), 0.5),
    "one factor of two properties": Cause((WEIGHTS,), 0.5),
    "one value of many that others lack": Cause((DAMPING,), 0.5),
    "values of many that others lack": Cause((UNLIKE,), 0.5),
    "unlike values of many": Cause((tuple(replace(f, b=f.b + i) for i, f in enumerate(MASSES)),), 0.5),
    "unlike values of two parts": Cause((ROTORS,), 0.5),
    "unlike properties of many": Cause((tuple(replace(f, part=p) for p in BODIES[:3] for f in BODY_FACTS),), 0.5),
    "left and right": Cause(
        (tuple(value(part, "damping", 0.1, 0.2, "N m s/rad") for part in ("left_knee", "right_knee")),), 0.5
    ),
    "subtrees that one side lacks": Cause((tuple(replace(FACTS["branch"], part=p) for p in JOINTS[:4]),), math.nan),
    "limits that many lack": Cause((LIMITS,), 0.0, "unseen"),
    "content that one side lacks": Cause((TENDONS,), math.nan),
    "two that cancel": Cause((BODY_FACTS, (FACTS["placement"],)), 1.0),
    "many that cancel": Cause((BODY_FACTS, (FACTS["placement"],), (FACTS["sign"],), MASSES), 1.0),
    "one rounded value": Cause(((FACTS["mass by a little"],),), 0.0, "digits"),
    "rounding": Cause((BODY_FACTS,), 0.0, "digits"),
    "small": Cause((BODY_FACTS, (FACTS["placement"],), (FACTS["damping"],), MASSES), 2e-5, "small"),
}


def _reason(slip: str, *values: str | float, facts: tuple[Fact, ...] = (FACTS["mass"],), part: str = "") -> Reason:
    return Reason(slip, facts, values, part)


PLACES, TENSORS, CENTRES, COUPLED = ((FACTS[what],) for what in ("placement", "inertia", "com", "polynomial"))
REASONS = (
    _reason("unit", "g"),
    _reason("unit", "degrees", facts=(FACTS["limits"],)),
    _reason("unit of A", "mm", facts=CENTRES),
    _reason("unit", "mm", facts=(FACTS["whole, in other units"],)),
    _reason("degrees", "B", facts=PLACES),
    _reason("radians", "A", facts=PLACES),
    _reason("sequence", "B", "XYZ", "xyz", facts=PLACES),
    _reason("w last", "B", facts=PLACES),
    _reason("left out"),
    _reason("decimal point", -1),
    _reason("other sign", facts=CENTRES),
    _reason("mirrored", "y", facts=CENTRES),
    _reason("order", "zyx", facts=CENTRES),
    _reason("turned", 12.3456, facts=TENSORS),
    _reason("turned by inertial", "A", facts=CENTRES),
    _reason("turned back by inertial", "A", facts=CENTRES),
    _reason("counted back", facts=(FACTS["rest"],)),
    *(_reason(slip, facts=COUPLED) for slip in ("exchanged coefficients", "inverse multiplier", "inverse function")),
    _reason("offset in degrees", facts=COUPLED),
    _reason("upside down", facts=(FACTS["gravity"],)),
    *(_reason(slip, facts=TENSORS) for slip in ("about the origin", "parallel axis twice")),
    *(
        _reason(slip, "A", facts=TENSORS)
        for slip in ("not turned", "turned twice", "turned transposed", "meant transposed")
    ),
    *(
        _reason(slip, facts=TENSORS)
        for slip in ("products of opposite sign", "no products", "urdf order", "mjcf order")
    ),
    _reason("product of opposite sign", "xy", facts=TENSORS),
    *(_reason(slip, facts=TENSORS) for slip in ("order of products", "order of moments", "moments on other axes")),
    *(_reason(slip, facts=PLACES) for slip in ("transposed", "no rotation")),
    *(_reason(slip, "B", facts=BODY_FACTS) for slip in ("inertiafromgeom", "default density", "geoms")),
    _reason("density", 1000.0, 1200.0, facts=MASSES),
    _reason("settotalmass", "B", 5.0, facts=MASSES),
    _reason("total kept", 5.0, facts=MASSES),
    _reason("joint order", f"{J}, {K}", f"{K}, {J}", "", facts=[FACTS["axis"], FACTS["name"]]),
    _reason("exchanged", *BODIES[:2], facts=MASSES[:2]),
    *(_reason(slip, "B", 100.0, facts=ROTORS) for slip in ("before the gear", "gear once")),
    _reason("missing part", "hand", "B", facts=BODY_FACTS),
    *(
        _reason(f"merged {how}", "hand", "B", facts=BODY_FACTS)
        for how in ("without rotation", "transposed", "without position", "by the inverse", "without parallel axis")
    ),
    _reason("turned", 12.3456, facts=TENSORS, part="hand"),
)


def lines() -> Iterator[str]:
    full, brief = (Speaker(MACHINE, brief=short) for short in (False, True))
    for title, some, tell in (("Facts", FACTS, Speaker.sentence), ("Causes", CAUSES, Speaker.cause)):
        yield f"# {title}"
        for name, each in some.items():
            long, short = tell(full, each), tell(brief, each)
            yield f"{name}: {long}"
            if short != long:
                yield f"    {short}"
    yield "# Names of causes"
    yield from (full.name(cause.groups[0]) for cause in CAUSES.values())
    yield "# Reasons"
    yield from (f"{reason.slip}: {phrase(reason)}" for reason in REASONS)


if __name__ == "__main__":
    FILE.write_text("\n".join(lines()) + "\n", encoding="utf-8")
