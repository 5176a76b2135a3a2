"""Reads a diagnosis as a user does: first sentence, rows, numbers with units, and named parts."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from campaigns.corpus.planted import WORDS, Planted, Site
from campaigns.corpus.poses import EYE, Array

#: A size is right within so much of it: a sentence prints three or four digits.
CLOSE = 0.02
#: Rows of the first screen.
FIRST = 3
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_SCALES = {
    "mm": 1e-3,
    "cm": 1e-2,
    "m": 1.0,
    "um": 1e-6,
    "rad": 1.0,
    "deg": np.pi / 180.0,
    "%": 1e-2,
    "relative": 1.0,
    "kg": 1.0,
    "g": 1e-3,
    "kg m^2": 1.0,
    "kg m2": 1.0,
    "": 1.0,
}
_UNIT = r"(kg m\^2|kg m2|mm|cm|um|m/s\^2|m|rad|deg|%|relative|kg|g|N m s/rad|N s/m|N m/rad|N/m|N m|N)?(?![\w])"
_SCALAR = re.compile(rf"(?<![\w.^])({_NUMBER})\s*{_UNIT}")
_SIDES = re.compile(rf"({_NUMBER})\s*{_UNIT} in B(?: \([^)]*\))?, ({_NUMBER})\s*{_UNIT} in A")
_VECTOR = re.compile(rf"\(({_NUMBER}(?:,\s*{_NUMBER})+)\)\s*{_UNIT}")
_ALONG = re.compile(rf"({_NUMBER})\s*(mm|cm|m|deg|rad) (?:along|about) (?:its |the )?([xyz])\b")
_OWN = re.compile(rf"({_NUMBER})\s*(mm|m|deg|rad) (?:along|about) (?:its|the joint's|its own) (?:own )?axis")


@dataclass(frozen=True, slots=True)
class Row:
    items: frozenset[str]
    text: str
    convention: bool = False


@dataclass(frozen=True, slots=True)
class Said:
    """The text of a diagnosis.

    Attributes:
        answer: ``SAME``, ``CONVENTIONS`` (the same machine, whose coordinates count otherwise), ``PARTLY`` (what is
            compared is the same, and not all is compared), ``DIFFER`` or ``REFUSED``.
        first: Its first rows, as many as the first screen has; or its first sentence where it has none.
        shown: Rows by cause.
    """

    answer: str
    first: str
    rows: tuple[Row, ...] = ()
    shown: int = 0


def said_by(diagnosis: Any) -> Said:
    """Read a `screwgauge.Diagnosis`."""
    rows = tuple(
        Row(
            frozenset({str(getattr(each, "item_a", "")), str(getattr(each, "item_b", ""))} - {""}),
            each.sentence,
            is_convention(each.sentence) or getattr(each, "kind", "") == "convention",
        )
        for each in diagnosis.differences
        if getattr(each, "kind", "") != "digits"
    )
    causes = [cause.sentence for cause in diagnosis.causes]
    first = "; ".join(causes[:FIRST]) or re.split(r"(?<=[^\s.])\.(?:\s+(?=\S)|$)", diagnosis.verdict)[0]
    if rows and all(row.convention for row in rows):
        answer = "CONVENTIONS"
    else:
        answer = "SAME" if diagnosis.same else "PARTLY" if diagnosis.undecided else "DIFFER"
    return Said(answer, first, rows, len(causes))


def is_convention(sentence: str) -> bool:
    return bool(re.search(r"counts the other way|its zero is|counts? .* more than|other order", sentence))


def first_place(text: str, names: frozenset[str]) -> float:
    found = (re.search(rf"(?<![\w.]){re.escape(name)}(?![\w]|\.\w)", text) for name in names)
    return min((each.start() for each in found if each), default=np.inf)


def mentions(text: str, names: frozenset[str]) -> bool:
    return np.isfinite(first_place(text, names))


def named(said: Said, site: Site) -> bool:
    words = "|".join(WORDS[what] for what in (site.planted.what, *site.planted.may))
    first = said.first.split("; explains")[0]
    return (not site.names or mentions(first, site.names)) and bool(re.search(words, first, re.IGNORECASE))


def of_item(said: Said, site: Site) -> str:
    rows = [
        row.text for row in said.rows if row.items & site.names or (not site.names and mentions_property(row, site))
    ]
    return " ; ".join([said.first.split("; explains")[0], *rows])


def mentions_property(row: Row, site: Site) -> bool:
    return bool(re.search(WORDS[site.planted.what], row.text, re.IGNORECASE))


def others(said: Said, sites: list[Site]) -> list[str]:
    def planted(row: Row) -> bool:
        for site in sites:
            words = "|".join(WORDS[what] for what in (site.planted.what, *site.planted.may))
            part = not site.names or bool(row.items & site.names) or (not row.items and mentions(row.text, site.names))
            if part and re.search(words, row.text, re.IGNORECASE):
                return True
        return False

    return [row.text for row in said.rows if not row.convention and not planted(row)]


def measured(text: str, site: Site) -> tuple[bool, bool]:
    planted = site.planted
    if planted.step is None:
        return True, True
    if np.ndim(planted.step) == 0:
        return _scalar(text, planted)
    return _vector(text, site)


def near(x: float, y: float) -> bool:
    return abs(x - y) <= CLOSE * abs(y) + 1e-300


def _scalars(text: str) -> Iterator[tuple[float, str, str]]:
    for found in _SCALAR.finditer(_VECTOR.sub(" ", text)):
        number, unit = found.group(1), found.group(2) or ""
        yield float(number) * _SCALES.get(unit, 1.0), unit, number[0] if number[0] in "+-" else ""


def _scalar(text: str, planted: Planted) -> tuple[bool, bool]:
    old, new = float(planted.old or 0.0), float(planted.new or 0.0)  # type: ignore[arg-type]
    if planted.share != 1.0:  # what moves as one has one number
        found = _scalar(text, replace(planted, new=old + planted.share * (new - old), share=1.0))
        if all(found):
            return found
    step = new - old
    for pair in _SIDES.finditer(text):
        values = [float(pair.group(k)) * _SCALES.get(pair.group(k + 1) or "", 1.0) for k in (1, 3)]
        if near(values[0] - values[1], step):
            return True, True
    magnitude, signed = _by_step(text, old, step)
    factors = [float(x) for x in re.findall(rf"(?:times|x|factor(?: of)?|by) ({_NUMBER})", text)]
    if signed or (old and any(near(factor, new / old) for factor in factors)) or _by_vectors(text, planted):
        return True, True
    plain = [value for value, *_ in _scalars(text)]
    if "in B" not in text and any(abs(v - old) <= 0.02 * abs(step) for v in plain):
        both = any(abs(v - new) <= 0.02 * abs(step) for v in plain)
        return magnitude or both, both
    return magnitude, False


def _by_step(text: str, old: float, step: float) -> tuple[bool, bool]:
    """Return two flags: a number is the step or its share of the old value, and its sign is written and right."""
    share, magnitude = step / old if old else np.inf, False
    for value, unit, sign in _scalars(text):
        for target in [share] if unit in ("%", "relative") else [step, share]:
            if near(abs(value), abs(target)):
                magnitude = True
                if sign and near(value, target):
                    return True, True
    return magnitude, False


def _by_vectors(text: str, planted: Planted) -> bool:
    if planted.what not in ("inertia", "limits", "coupling"):
        return False
    old, new = float(planted.old or 0.0), float(planted.new or 0.0)  # type: ignore[arg-type]
    pairs = [(b, a) for b, a in pairwise(_vectors(text)) if a.shape == b.shape]
    scaled = planted.what == "inertia" and any(np.allclose(b, new / old * a, rtol=CLOSE) for b, a in pairs)
    return scaled or any(near(x, new - old) for b, a in pairs for x in b - a)


def _vectors(text: str) -> list[Array]:
    """In SI."""
    found = _VECTOR.finditer(text)
    return [np.array([float(x) for x in v.group(1).split(",")]) * _SCALES.get(v.group(2) or "", 1.0) for v in found]


def _vector(text: str, site: Site) -> tuple[bool, bool]:
    steps = site.steps
    sizes = {float(np.linalg.norm(step)) for step in steps}

    def fits(v: Array) -> bool:
        return any(v.shape == s.shape and np.linalg.norm(v - s) <= CLOSE * np.linalg.norm(s) for s in steps)

    vectors = _vectors(text)
    if any(fits(v) for v in vectors):
        return True, True
    if any(fits(b - a) for b, a in pairwise(vectors) if a.shape == b.shape):
        return True, True
    magnitude = any(near(abs(value), size) for value, unit, _ in _scalars(text) for size in sizes if unit != "%")
    for found in _ALONG.finditer(text):
        value = float(found.group(1)) * _SCALES[found.group(2)]
        if fits(value * EYE["xyz".index(found.group(3))]):
            return True, True
    axis = site.planted.axis
    if axis is not None:
        own = float(np.asarray(site.planted.step) @ axis)
        for found in _OWN.finditer(text):
            if near(float(found.group(1)) * _SCALES[found.group(2)], own):
                return True, True
    return magnitude, False
