"""Tries typical mistakes (slips) in single values, and reads the text of a model file in different conventions."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, permutations, product
from pathlib import Path

import numpy as np

from screwgauge.diagnosis.facts.fact import ALL, digits_of
from screwgauge.diagnosis.properties import ANGLE, UNITS
from screwgauge.models.files import mjcf, urdf
from screwgauge.models.files.xml import Element, TextLink, XmlText, numbers
from screwgauge.models.formats import TENSOR
from screwgauge.models.matter import NOTHING, Matter, steiner
from screwgauge.models.poses import matrix, relative
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.files import read_file
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array, rotation_vector

#: Largest misfit of a slip: relative, and in units of the last printed digit.
LEFT, SUM = 1e-6, 5.0
#: Default density of geoms [kg/m^3].
WATER = 1000.0
#: Euler angle sequences in MJCF's notation; capitals denote fixed axes, as in URDF.
URDF = "XYZ"
_SEQUENCES = [text for order in permutations("xyz") for text in ("".join(order), "".join(order).upper())]

#: Key of a slip, followed by the names and numbers to insert into its sentence.
Slip = tuple[str | float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Written:
    """The parsed text of a model file, or an empty record if there is no file.

    Attributes:
        form: ``urdf`` or ``mjcf``.
        links: Links, parents first.
        options: Attributes of all ``<compiler>`` elements.
        densities: Densities that the geoms specify [kg/m^3].
        total: Mass to which the model is scaled [kg], or 0.
        loose: Relative error implied by the printed digits.
    """

    form: str = ""
    links: Sequence[TextLink] = ()
    options: Mapping[str, str] = field(default_factory=dict)
    densities: tuple[float, ...] = ()
    loose: float = LEFT
    total: float = 0.0

    def link(self, name: str) -> TextLink | None:
        """Return the link with the given name, or None."""
        return next((link for link in self.links if link.name == name), None)

    @property
    def plain(self) -> dict[str, Array]:
        """Frames of the ground and of all links, as the file gives them. Shape (4, 4) each."""
        return {GROUND: np.eye(4), **{link.name: link.frame for link in self.links}} if self.links else {}

    def meanings(self, holder: Element | None) -> Iterator[tuple[Slip, Array]]:
        """Yield the rotations of an element as read in other conventions for units, Euler sequence or quaternions."""
        place = holder and (holder.find("origin") if self.form == "urdf" else holder)
        text = place and place.get("rpy" if self.form == "urdf" else "euler")
        if place and self.form == "mjcf" and (quat := place.get("quat")):
            yield ("w last",), _rotation({"quat": " ".join([quat.split()[-1], *quat.split()[:-1]])}, {})
        if not text:
            return
        own = URDF if self.form == "urdf" else self.options.get("eulerseq", "xyz")
        units = ["radian", "degree"]
        if self.form == "mjcf" and self.options.get("angle") != "radian":
            units.reverse()
        yield (f"{units[1]}s",), _rotation({"euler": text}, {"eulerseq": own, "angle": units[1]})
        if np.count_nonzero(numbers(text)) > 1:
            for other in (each for each in _SEQUENCES if each != own):
                yield ("sequence", own, other), _rotation({"euler": text}, {"eulerseq": other, "angle": units[0]})

    def frames(self) -> Iterator[tuple[Slip, dict[str, Array]]]:
        """Yield the frames of all links, with placements read in a different convention. Shape (4, 4) each."""
        others = [dict(self.meanings(link.mount)) for link in self.links]
        for slip in dict.fromkeys(slip for each in others for slip in each):
            frames: list[Array] = []
            for link, turns in zip(self.links, others, strict=True):
                if link.near < 0:
                    frames.append(link.frame)
                    continue
                local = relative(link.base, relative(self.links[link.near].frame, link.frame))
                local = matrix(local[:3, 3], turns[slip]) if slip in turns else local
                frames.append(frames[link.near] @ link.base @ local)
            yield slip, {GROUND: np.eye(4), **{link.name: F for link, F in zip(self.links, frames, strict=True)}}

    def from_geoms(self, name: str, library: str) -> str:
        """Return the slip if a link's mass properties come from its geoms; empty if the file specifies them."""
        link = self.link(name)
        geoms = [each for each in link.element.children if each.tag in ("geom", "collision")] if link else []
        if geoms and library == "mujoco" and self.options.get("inertiafromgeom") == "true":
            return "inertiafromgeom"
        if not geoms or self.form == "urdf" or (link and link.matter):
            return ""
        stated = any(geom.get(key) for geom in geoms for key in ("mass", "density", "class", "mesh"))
        return "geoms" if stated or self.densities else "default density"


def parse_file(file: Path | None) -> Written:
    """Parse a model file; return an empty record if it is neither URDF nor MJCF."""
    try:
        text = read_file(file) if file else ""
        xml = XmlText(text, "the model file")
        form = "urdf" if xml.root.tag == "robot" else "mjcf"
        links = urdf.links(xml) if form == "urdf" else mjcf.links(xml)
        options = {key: value for each in xml.root.iter("compiler") for key, value in each.attributes.items()}
        total = float(options.get("settotalmass", "0"))
        densities = tuple(float(density) for each in xml.root.iter("geom") if (density := each.get("density")))
    except (ScrewgaugeError, ValueError, LookupError):
        return Written()
    digits = digits_of(text)
    loose = LEFT if digits == ALL else max(LEFT, SUM * 10.0 ** (1 - digits))
    return Written(form, links, options, densities, loose, total)


def _rotation(attributes: dict[str, str], compiler: Mapping[str, str]) -> Array:
    return mjcf.pose(Element("body", attributes, 0, None), compiler)[:3, :3]


#: Largest share of a difference that a slip may leave unexplained, regardless of the printed digits.
SHARE = 1e-2
#: Range of the number of digits of a rounded number; angles may have three, e.g. 1.57 for 90 degrees.
FEWEST, MOST = 4, 8
#: Largest relative difference between moments of inertia that count as equal; smallest reported rotation [degrees].
EQUAL, TURN = 1e-3, 0.01
_AXES = "xyz"

Guesses = Iterator[tuple[Slip, Array]]


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """A value in both models, expressed in one frame.

    Attributes:
        a, b: Values in A and in B.
        unit: SI unit.
        loose: Relative error implied by the printed digits.
        matter: Mass properties of the body in A to which the value belongs.
        frames: Axes in which each file gives the value. Shape (3, 3) each.
        turns: Slips in these axes, and the rotation that each slip applies to A's value. Shape (3, 3) each.
    """

    a: Array
    b: Array
    unit: str = ""
    loose: float = LEFT
    matter: Matter = NOTHING
    frames: Mapping[str, Array] | None = None
    turns: Sequence[tuple[Slip, Array]] = ()

    def fits(self, value: Array) -> bool:
        """Return True if a value equals B's to the precision of the files, and fits much better than A's value."""
        before, large = float(np.abs(self.b - self.a).max()), float(np.abs(self.a).max())
        left = max(self.loose * float(np.abs(self.b).max()), 1e-9 * large)
        return before > self.loose * large and float(np.abs(value - self.b).max()) <= min(left, SHARE * before)

    def slips(self, what: str) -> list[Slip]:
        """Return slips that reproduce B's value, one per kind; try a later entry only if no earlier entry fits."""
        for entry in ENTRIES.get(what, NUMBER):
            found = dict[str | float, Slip]()
            guesses = [((entry,), PLAIN[entry](self.a))] if isinstance(entry, str) else entry(self)
            for slip, value in guesses:
                if slip[0] not in found and self.fits(value):
                    found[slip[0]] = slip
            if found:
                return [*found.values()]
        return []


def rounding(*values: Array, least: int = FEWEST) -> float:
    """Return the largest relative rounding error of the numbers; `LEFT` if no number is rounded."""
    digits = (re.sub(r"e.*|\.", "", f"{abs(float(x)):.12g}").strip("0") for each in values for x in np.ravel(each))
    return max([LEFT, *(0.5 / int(text) for text in digits if least <= len(text) <= MOST)])


def units(t: Trial) -> Guesses:
    """Try different units for A and for B."""
    least = 3 if UNITS.get(t.unit) is ANGLE else FEWEST
    near = Trial(t.a, t.b, t.unit, max(t.loose, rounding(t.a, t.b, least=least)))
    for factor, name in UNITS.get(t.unit, {}).items():
        for slip, value in ((("unit", name), factor * t.a), (("unit of A", name), t.a / factor)):
            if t.b.any() and near.fits(value):
                yield slip, t.b  # equal to the precision of the files


def one_number(t: Trial) -> Guesses:
    """Try one number with the opposite sign, or with its decimal point moved."""
    for i in map(tuple, np.argwhere(t.a)):
        guesses = [("decimal point", places) for places in (1, -1, 2, -2, 3, -3)]
        for slip, factor in ((("other sign",), -1.0), *((slip, 10.0 ** slip[1]) for slip in guesses)):
            value = t.a.copy()
            value[i] *= factor
            if t.a.ndim == 2:
                value[i[::-1]] = value[i]
            yield slip, value


def vector(t: Trial) -> Guesses:
    """Try a vector mirrored, permuted, or rotated into another frame."""
    for n in (1, 2, 3):
        for axes in combinations(np.flatnonzero(t.a), n):
            value = t.a.copy()
            value[list(axes)] *= -1.0
            yield ("mirrored", " and ".join(_AXES[i] for i in axes)), value
    for order in permutations(range(3)):
        yield ("order", "".join(_AXES[i] for i in order)), t.a[list(order)]
    for side, R in (t.frames or {}).items():
        yield ("turned by inertial", side), R @ t.a
        yield ("turned back by inertial", side), R.T @ t.a


def polynomial(t: Trial) -> Guesses:
    """Try an exchanged offset and multiplier, an inverse multiplier or function, and an offset in degrees."""
    offset, multiplier, *more = (*t.a, 0.0)
    if len(t.a) > 1 and multiplier and not any(more):
        guesses = {
            "exchanged coefficients": (multiplier, offset),
            "offset in degrees": (np.degrees(offset), multiplier),
            "inverse multiplier": (offset, 1.0 / multiplier),
            "inverse function": (-offset / multiplier, 1.0 / multiplier),
        }
        yield from (((slip,), np.append(value, more[:-1])) for slip, value in guesses.items())


def direction(t: Trial) -> Guesses:
    """Try a vector of equal length in a different direction."""
    a, b = (float(np.linalg.norm(each)) for each in (t.a, t.b))
    if a and b and abs(a - b) < t.loose * a:
        yield ("turned", float(np.degrees(np.arctan2(np.linalg.norm(np.cross(t.a, t.b)), t.a @ t.b)))), t.b


def tensor(t: Trial) -> Guesses:
    """Try mistakes in the reference point, the axes and the entries of an inertia tensor."""
    away = t.matter.mass * steiner(t.matter.com)
    yield ("about the origin",), t.a + away
    yield ("parallel axis twice",), t.a - away
    for slip, Q in t.turns:
        yield slip, Q @ t.a @ Q.T
    for side, R in (t.frames or {}).items():
        for key, Q in (
            ("not turned", R.T),
            ("turned twice", R),
            ("turned transposed", R.T @ R.T),
            ("meant transposed", R @ R),
        ):
            yield (key, side), Q @ t.a @ Q.T
        for slip, value in _entries(R.T @ t.a @ R):
            yield slip, R @ value @ R.T
    values, V = np.linalg.eigh(t.a)
    for order in permutations(range(3)):
        yield ("moments on other axes",), V @ np.diag(values[list(order)]) @ V.T


def _entries(I: Array) -> Guesses:
    """Try mistakes in the entries of a tensor, given in the axes of the file."""
    moments = np.diag(np.diag(I))
    yield ("products of opposite sign",), 2.0 * moments - I
    yield ("no products",), moments
    products, diagonal, mjcf, urdf = ("xy", "xz", "yz"), ("xx", "yy", "zz"), tuple(TENSOR), tuple(sorted(TENSOR))
    orders = [("urdf order", mjcf, urdf), ("mjcf order", urdf, mjcf)]
    orders += [("order of products", products, order) for order in permutations(products)]
    orders += [("order of moments", diagonal, order) for order in permutations(diagonal)]
    for key, names, others in orders:
        value = I.copy()
        for (i, j), other in zip((TENSOR[name] for name in names), others, strict=True):
            value[i, j] = value[j, i] = I[TENSOR[other]]
        yield (key,), value


def axes(t: Trial) -> Guesses:
    """Try a tensor with equal moments about different axes."""
    (one, V), (two, W) = np.linalg.eigh(t.a), np.linalg.eigh(t.b)
    if np.abs(one - two).max() > min(t.loose * np.abs(t.b).max(), SHARE * np.abs(t.a - t.b).max()):
        return
    apart = np.diff(one) > EQUAL * one[2]
    if apart.all():
        turns = [W @ np.diag(signs) @ V.T for signs in product((1.0, -1.0), repeat=3)]
        angle = min(float(np.linalg.norm(rotation_vector(R))) for R in turns if np.linalg.det(R) > 0.0)
    else:  # ignore rotations about the axis between two equal moments
        k = 2 if apart[1] else 0
        angle = float(np.arccos(min(1.0, abs(float(V[:, k] @ W[:, k])))))
    if np.degrees(angle) > TURN:
        yield ("turned", float(np.degrees(angle))), t.b


def one_entry(t: Trial) -> Guesses:
    """Try one tensor entry with the opposite sign or with its decimal point moved, in the axes of either file."""
    for R in (t.frames or {"": np.eye(3)}).values():
        yield from ((slip, R @ value @ R.T) for slip, value in one_number(Trial(R.T @ t.a @ R, t.b)))


#: Slips that depend only on A's value.
PLAIN: Mapping[str, Callable[[Array], Array]] = {
    "left out": np.zeros_like,
    "upside down": np.negative,
    "counted back": lambda a: -a[::-1],
    "transposed": np.transpose,
    "no rotation": lambda a: np.eye(3),
}
Entry = str | Callable[[Trial], Guesses]
#: Entries for a number and for properties, most likely first; a later entry is tried only if no earlier one fits.
NUMBER: Sequence[Entry] = (units, one_number)
ENTRIES: Mapping[str, Sequence[Entry]] = {
    "mass": (units, "left out", one_number),
    "com": (units, "left out", vector, one_number),
    "inertia": (units, tensor, axes, one_entry),
    "limits": (units, "counted back", one_number),
    "polynomial": (polynomial, one_number),
    "gravity": (units, "left out", "upside down", direction, one_number),
    "position": (units, "left out", vector, one_number),
    "rotation": ("transposed", "no rotation"),
}
