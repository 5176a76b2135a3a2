"""What the text of a model file says of rotations, geoms and compiler options, and what else it may mean."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations
from pathlib import Path

import numpy as np

from screwgauge.diagnosis.facts.digits import ALL, digits_of
from screwgauge.models.files import mjcf, urdf
from screwgauge.models.files.xml import Element, TextLink, XmlText, numbers
from screwgauge.models.poses import matrix, relative
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.files import read_file
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array

#: What a slip may leave of B's value, relative, and in units of the last digit that a file prints.
LEFT, SUM = 1e-6, 5.0
#: Density of geoms that state none [kg/m^3].
WATER = 1000.0
#: Sequences of Euler angles as MJCF names them; capitals are about axes that stay, as in URDF.
URDF = "XYZ"
_SEQUENCES = [text for order in permutations("xyz") for text in ("".join(order), "".join(order).upper())]

#: Key of a slip, and the names and numbers that its words need.
Slip = tuple[str | float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Written:
    """The text of a model file; nothing where there is none.

    Attributes:
        form: ``urdf`` or ``mjcf``.
        links: Each after the one that carries it.
        options: Of all ``<compiler>`` elements.
        densities: That its geoms state [kg/m^3]; `total`: mass to which all is scaled [kg], 0 where it is not.
        loose: What its printed digits leave of a value, relative.
    """

    form: str = ""
    links: Sequence[TextLink] = ()
    options: Mapping[str, str] = field(default_factory=dict)
    densities: tuple[float, ...] = ()
    loose: float = LEFT
    total: float = 0.0

    def link(self, name: str) -> TextLink | None:
        """The link of that name."""
        return next((link for link in self.links if link.name == name), None)

    @property
    def plain(self) -> dict[str, Array]:
        """Frames of all links as written, and of the ground. Shape (4, 4) each."""
        return {GROUND: np.eye(4), **{link.name: link.frame for link in self.links}} if self.links else {}

    def meanings(self, holder: Element | None) -> Iterator[tuple[Slip, Array]]:
        """What else the rotation in an element may mean; none where it is a single angle in another place."""
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
        """Frames of all links, with all placements taken in another meaning. Shape (4, 4) each."""
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
        """Slip by which mass and inertia of a link come from its geoms; empty where they do not."""
        link = self.link(name)
        geoms = [each for each in link.element.children if each.tag in ("geom", "collision")] if link else []
        if geoms and library == "mujoco" and self.options.get("inertiafromgeom") == "true":
            return "inertiafromgeom"
        if not geoms or self.form == "urdf" or (link and link.matter):
            return ""
        stated = any(geom.get(key) for geom in geoms for key in ("mass", "density", "class", "mesh"))
        return "geoms" if stated or self.densities else "default density"


def written(file: Path | None) -> Written:
    """Read what a file says; one that is no URDF or MJCF says nothing."""
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
