import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass, field

from campaigns.corpus.poses import EYE, Array, Random

#: What may be done.
NAMES, ORDER, FRAMES, HOME, SIGNS = "names", "order", "frames", "home", "signs"
#: What leaves coordinates as they are.
QUIET = frozenset({NAMES, ORDER, FRAMES})
ALL = QUIET | {HOME, SIGNS}


@dataclass(slots=True)
class Scrambled:
    """The changes that a scrambler made in a file.

    Attributes:
        names: ``joint OLD``, ``body OLD`` and so on -> new name.
        frames: Old name of a link or body -> its new frame in the old one. Shape (4, 4).
        homes: Old name of a joint -> its old coordinate at the new home.
        flipped: Old names of joints whose axis was reversed.
    """

    root: ET.Element
    names: dict[str, str] = field(default_factory=dict)
    frames: dict[str, Array] = field(default_factory=dict)
    homes: dict[str, float] = field(default_factory=dict)
    flipped: set[str] = field(default_factory=set)

    def axes(self, body: str) -> Array:
        return self.frames[body][:3, :3] if body in self.frames else EYE

    def called(self, kind: str, name: str) -> str:
        return self.names.get(f"{kind} {name}", name)


def numbered(names: Iterable[str | None], word: str, rng: Random) -> dict[str, str]:
    some = [*dict.fromkeys(name for name in names if name)]
    return {name: f"{word}{i}" for name, i in zip(some, rng.permutation(len(some)), strict=True)}


def shuffled(parent: ET.Element, rng: Random, tags: Iterable[str] = ()) -> None:
    some = {*tags}
    moved = [child for child in parent if not some or child.tag in some]
    for child in moved:
        parent.remove(child)
    parent.extend(moved[int(i)] for i in rng.permutation(len(moved)))


def coordinate(kind: str, rng: Random, length: float = 0.02) -> float:
    return (
        float(rng.uniform(-0.4, 0.4))
        if kind in ("revolute", "continuous", "hinge")
        else float(rng.uniform(-length, length))
    )
