"""Planted edits, by which a sentence can be judged without the package."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from campaigns.corpus.poses import EYE, Array

#: Property -> words by which a sentence names it, as regular expressions.
WORDS = {
    "mass": r"(?<!centre of )\bmass(es)?\b(?! matrix)",
    "com": r"centres? of mass",
    "inertia": r"\binertia|moments? of inertia|principal moments",
    "placement": r"sits elsewhere|\bplace(ment)?\b|\borigin|\bshift|\bmoved\b|\bturned\b|\belsewhere|\baxis\b|\boff\b",
    "axis": r"\baxis\b|\btilt|sits elsewhere|\bturned\b|\bplacement",
    "sign": r"other way|revers|opposite|\bsign\b",
    "zero": r"\bzero\b|counts|home",
    "limits": r"\blimits?\b|\brange\b",
    "damping": r"\bdamping\b",
    "friction": r"friction",
    "armature": r"\barmature\b",
    "stiffness": r"\bstiffness\b|\bspring",
    "gear": r"\bgear\b",
    "gravcomp": r"compensation|gravcomp|weight",
    "closure": r"\bframe on\b|\bclosure|\bconnect|\bpoint\b|\banchor|\bloop|\belsewhere",
    "coupling": r"\bfollows\b|\bcoupling|\bmimic|\bmultiplier|\bfactor",
    "gravity": r"\bgravity\b",
    "kind": r"does not move|\bfixed\b|\bmissing\b|\bslide|\bhinge|\bprismatic|\brevolute|in [AB] only",
}


@dataclass(frozen=True, slots=True, eq=False)
class Planted:
    """An edit as data.

    Attributes:
        kind: Of edit, as in the table of edits.
        item: What was edited, as A's file calls it, with its kind, such as ``joint elbow``; empty for the model.
        what: Property of `WORDS`.
        old, new: Numbers in SI units: a scalar, or a vector in axes of `at`; None where there are none.
        delta: Of vectors that are told by their difference alone; a rotation vector of turns [rad].
        at: Body in whose axes vectors are, empty for the world.
        also: Items that may be named in its place: the body that a link is fixed to.
        may: Further properties that such an edit changes.
        axis: Of the joint that turns or slides, in axes of `at`.
        turns: Whether `delta` is a turn.
        share: Of the mass of what moves as one with a body: so much of a step the common centre of mass is off.
    """

    kind: str
    item: str
    what: str
    old: float | Array | None = None
    new: float | Array | None = None
    delta: Array | None = None
    at: str = ""
    also: Sequence[str] = ()
    may: Sequence[str] = ()
    axis: Array | None = None
    turns: bool = False
    share: float = 1.0

    @property
    def step(self) -> float | Array | None:
        """From A to B."""
        if self.delta is not None:
            return self.delta
        return None if self.new is None or self.old is None else self.new - self.old


@dataclass(frozen=True, slots=True, eq=False)
class Site:
    """The place of an edit in the two files: names there, and axes of frames that a sentence may use.

    Attributes:
        names: Of the item and what may be named in its place, in A and in B.
        axes: Rotations that take a vector of `Planted.at` to axes that a sentence may give it in.
    """

    planted: Planted
    names: frozenset[str]
    axes: tuple[Array, ...] = field(default=(EYE,))

    @property
    def steps(self) -> list[Array]:
        step = np.asarray(self.planted.step, dtype=float)
        return [share * R @ step for share in dict.fromkeys((1.0, self.planted.share)) for R in self.axes]
