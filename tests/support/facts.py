"""Facts of a diagnosis, compared with those of a table of claims."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest

from screwgauge.diagnosis.machine.whole import Whole

#: How far a number of a fact may be from the one that is claimed.
NEAR = {"rel": 1e-5, "abs": 1e-9}


def numbers_of(fact: Any) -> dict[str, Any]:
    """List what a row may claim of a fact; turns in degrees and ways in mm."""
    claimed = {key: getattr(fact, key) for key in ("part", "what", "a", "b", "unit", "size", "kind", "partner", "of")}
    claimed |= {"side": fact.side, "more": [*fact.more]}
    value = fact.b
    if isinstance(value, Whole):
        claimed |= {"length": value.length, "mass": value.mass, "inertia": value.inertia, "mirror": value.step[0]}
        value = value.step[1]
    if np.shape(value) == (2, 3) and np.asarray(value).dtype == float:
        claimed |= {"turn": np.degrees(value[0]), "way": 1e3 * np.asarray(value[1])}
        claimed |= {"angle": np.linalg.norm(claimed["turn"]), "distance": np.linalg.norm(claimed["way"])}
    return claimed


def fits(fact: Any, claim: Mapping[str, Any]) -> bool:
    has = numbers_of(fact)
    return all(key in has and same(has[key], value) for key, value in claim.items())


def matches(slip: Sequence[Any], claim: Sequence[Any]) -> bool:
    return len(slip) >= len(claim) and all(same(value, other) for value, other in zip(slip, claim, strict=False))


def same(value: Any, claimed: Any) -> bool:
    if value is None or isinstance(claimed, str) or (isinstance(claimed, list) and isinstance(claimed[0], str)):
        return bool(value == claimed or (isinstance(value, tuple) and [*value] == claimed))
    array = np.asarray(value, float)
    return array.shape == np.shape(claimed) and bool(array == pytest.approx(np.asarray(claimed, float), **NEAR))


def told(facts: Sequence[Any]) -> str:
    return "\n".join(str({key: value for key, value in numbers_of(fact).items() if key != "unit"}) for fact in facts)


def replaced(text: str, edits: Sequence[Sequence[str]]) -> str:
    for old, new in edits:
        assert old in text, f"{old} is not in the text"
        text = text.replace(old, new)
    return text
