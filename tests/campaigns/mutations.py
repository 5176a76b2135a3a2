import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from campaigns import changes
from campaigns.changes import CannotError, Random, distance, grown, off, shifted, times
from campaigns.marks import (
    Mark,
    anchors,
    children,
    end,
    inertials,
    is_urdf,
    joints,
    last_bodies,
    mimics,
    motors,
    placements,
    whole,
)

from screwgauge.models.files.xml import XmlText
from screwgauge.reference.rotations import Array

#: Item of a change of all parts.
EVERYWHERE = "*"
#: Slips with the orientation in which a tensor is written.
LOST, TRANSPOSED = "not turned by its orientation", "by the transpose of its orientation"
PASSIVE = ("armature", "damping", "friction", "stiffness", "rest")
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBERS = re.compile(rf"\s*{_NUMBER}(?:\s+{_NUMBER})*\s*")


@dataclass(frozen=True, slots=True)
class Expected:
    """What was changed.

    Attributes:
        item: Link or joint, as the file calls it; empty for the model, `EVERYWHERE` for all parts.
        what: Properties by which the change may be named; one of them has to be.
        magnitude: How large it is, by the norm of the difference of its numbers; NaN where there is none.
        slip: Words that have to be in the name of the slip, if it is one.
    """

    item: str
    what: tuple[str, ...]
    magnitude: float = np.nan
    slip: str = ""


#: Changes a model by a relative size; raises `CannotError` where the model has no place for it.
Mutation = Callable[[XmlText, Random, float], list[Expected]]


def pick(marks: list[Mark], rng: Random) -> Mark:
    """One of them.

    Raises:
        CannotError: There is none.
    """
    if not marks:
        raise CannotError("no such part")
    return marks[rng.integers(len(marks))]


@dataclass(frozen=True, slots=True)
class Kind:
    """Other numbers of one kind at one of the parts that have them.

    Attributes:
        of: Parts of a model.
        what: Numbers of a part, see `Mark.get`.
        change: Makes other numbers of them: ``change(numbers, size, rng, part)``.
        names: Properties by which the change may be named.
        fits: Whether a change of that part has an effect.
        measure: Magnitude of the change, of old numbers, new ones and the part; None where none is named.
    """

    of: Callable[[XmlText], list[Mark]]
    what: str
    change: Callable[..., Array]
    names: tuple[str, ...]
    slip: str = ""
    fits: Callable[[Mark], bool] = lambda mark: True
    measure: Callable[[Array, Array, Mark], float] | None = distance

    def __call__(self, xml: XmlText, rng: Random, size: float) -> list[Expected]:
        mark = pick([mark for mark in self.of(xml) if mark.has(self.what) and self.fits(mark)], rng)
        old = mark.get(self.what)
        new = self.change(old.copy(), size, rng, mark)
        if np.abs(new - old).max() <= 1e-9 * np.abs(old).max():
            raise CannotError("nothing would change")
        if self.what == "tensor" and np.linalg.eigvalsh(new).min() <= 0.0:
            raise CannotError("not an inertia tensor")
        magnitude = self.measure(old, new, mark) if self.measure else np.nan
        mark.put(self.what, new)
        return [Expected(mark.name, self.names, magnitude, self.slip)]


# --- what is there at all


def masses_swapped(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    marks = inertials(xml)
    one = pick(marks, rng)
    m = one.get("mass")
    two = pick([mark for mark in marks if abs(mark.get("mass") - m) > 1e-3 * m], rng)
    step = distance(m, two.get("mass"), one)
    one.put("mass", two.get("mass"))
    two.put("mass", m)
    return [Expected(mark.name, ("mass",), step) for mark in (one, two)]


def all_masses_factor(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    marks = inertials(xml)
    if len(marks) < 2:
        raise CannotError("fewer than two inertials")
    for mark in marks:
        mark.put("mass", grown(mark.get("mass"), size))
    return [Expected(EVERYWHERE, ("mass",), slip="mass of all")]


def joint_fixed(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    rooms = [room for room in xml.root.children if room.tag not in ("worldbody", "joint", "link")]
    parts = [*xml.root.iter("mimic"), *(part for room in rooms for part in room.iter())]
    referred = {value for part in parts for value in part.attributes.values()}
    mark = pick([mark for mark in joints(xml) if mark.name not in referred], rng)
    if is_urdf(xml):
        xml.set(mark.element, type="fixed")
    else:
        xml.replace(mark.element)
    return [Expected(mark.name, ("branch", "fixed"))]


def branch_missing(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    if not is_urdf(xml) or len(joints(xml)) < 2:
        raise CannotError("only of a URDF with several joints")
    mimicked = {element.get("joint") for element in xml.root.iter("mimic")}
    near = {end(joint, "parent") for joint in children(xml, "joint")}
    last = [mark for mark in joints(xml) if end(mark.element, "child") not in near and mark.name not in mimicked]
    mark = pick(last, rng)
    xml.replace(mark.element)
    for link in children(xml, "link"):
        if link.get("name") == end(mark.element, "child"):
            xml.replace(link)
    return [Expected(mark.name, ("branch", "fixed"))]


def digits(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    places, changed = 6 + int(rng.integers(2)), False
    for element in xml.root.iter():
        for name, text in element.attributes.items():
            words = text.split() if _NUMBERS.fullmatch(text) else []
            short = [f"{float(word):.{places}g}" for word in words]
            if any(float(a) != float(b) for a, b in zip(short, words, strict=True)):
                changed = True
                xml.set(element, **{name: " ".join(short)})
    if not changed:
        raise CannotError("all numbers are short")
    return [Expected("", ("digits",))]


def two_at_once(xml: XmlText, rng: Random, size: float) -> list[Expected]:
    names = (("mass_factor", "com_shift", "axis_tilted"), ("moment_factor", "placement_shift", "damping"))
    one, two = (KINDS[some[rng.integers(len(some))]](xml, rng, size)[0] for some in names)
    if one.item == two.item:
        raise CannotError("both are of one part")
    return [one, two]


_mass, _com = partial(Kind, inertials, "mass", names=("mass",)), partial(Kind, inertials, "position", names=("com",))
_tensor = partial(Kind, inertials, "tensor", names=("inertia",))
_written = partial(Kind, inertials, "turn", names=("inertia",), fits=changes.turned, measure=changes.turned_by)
_axis = partial(Kind, joints, "axis", fits=changes.own_axis)
_shift = partial(Kind, placements, "position", names=("placement",))
_turn = partial(Kind, placements, "turn", names=("placement", "axis"), measure=changes.angle)
KINDS: dict[str, Mutation] = {
    "mass_factor": _mass(grown),
    "mass_in_grams": _mass(times(1e3), slip="in g"),
    "masses_swapped": masses_swapped,
    "all_masses_factor": all_masses_factor,
    "com_shift": _com(shifted),
    "com_in_millimetres": _com(times(1e3), slip="in mm", fits=off),
    "com_mirrored": _com(lambda x, *_: np.where(np.arange(3) == np.abs(x).argmax(), -x, x), slip="mirrored", fits=off),
    "com_lost": _com(times(0.0), slip="left out", fits=off),
    "moment_factor": _tensor(changes.one_grown),
    "tensor_factor": _tensor(grown),
    "product_shift": _tensor(changes.product_more),
    "products_negated": _tensor(changes.negated, slip="have the opposite sign", fits=changes.asymmetric),
    "products_in_other_order": _tensor(
        changes.reordered, slip="products of inertia are in a different order", fits=changes.unlike_products
    ),
    "axes_permuted": _tensor(
        changes.permuted, slip="principal moments are assigned to different axes", fits=changes.principal
    ),
    "moments_permuted": _tensor(
        changes.permuted, slip="moments of inertia are in a different order", fits=changes.full
    ),
    "about_the_origin": _tensor(changes.about_the_origin, slip="about the origin", fits=off),
    "orientation_lost": _written(lambda R, *_: np.eye(3), slip=LOST),
    "orientation_transposed": _written(lambda R, *_: R.T, slip=TRANSPOSED),
    "tensor_in_gram_millimetres": _tensor(times(1e9), slip="in g mm^2"),
    "axis_reversed": _axis(times(-1.0), names=("sign",), measure=None),
    "axis_tilted": _axis(changes.tilted, names=("axis",)),
    "zero_offset": _turn(changes.turned_about, names=("zero", "placement"), fits=changes.pivoted),
    "limit_changed": Kind(
        joints, "limits", changes.last_more, ("limits",), fits=changes.limited, measure=changes.of_limit
    ),
    "placement_shift": _shift(shifted),
    "placement_turn": _turn(changes.turned_across),
    "placement_turn_lost": _turn(
        lambda R, *_: np.eye(3), slip="the rotation is left out", fits=changes.turned_axis, measure=None
    ),
    "placement_in_millimetres": _shift(times(1e3), slip="in mm", fits=off),
    "gravity_value": Kind(whole, "gravity", changes.pulled(2), ("gravity",)),
    "gravity_direction": Kind(whole, "gravity", changes.pulled(0), ("gravity",)),
    "compensation": Kind(last_bodies, "gravcomp", lambda x, size, *_: x + size, ("gravcomp",)),
    "gear_changed": Kind(motors, "gear", grown, ("gear",)),
    "joint_fixed": joint_fixed,
    "branch_missing": branch_missing,
    "digits": digits,
    "anchor_moved": Kind(anchors, "position", shifted, ("end",)),
    "coupling_changed": Kind(mimics, "multiplier", grown, ("polynomial",)),
    **{what: Kind(joints, what, changes.more, (what,)) for what in PASSIVE},
    "two_at_once": two_at_once,
}


def mutated(kind: str, text: str, rng: Random, size: float) -> tuple[str, list[Expected]]:
    """A model file with a change of some relative size, and what a diagnosis has to say of it.

    Raises:
        CannotError: The file has no place for that kind of change.
    """
    xml = XmlText(text, "the model")
    expected = KINDS[kind](xml, rng, size)
    return xml.text(), expected
