"""Which library does not use what, where two read one file, and the case of the casebook that shows it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from screwgauge.diagnosis.change import PROPERTIES, Difference
from screwgauge.diagnosis.common import STANDARD
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.words import NAMES

#: Value of a property that no file has to say, for all that is not zero.
_DEFAULTS = {"gravity": STANDARD}
_OPTIONAL = ("gravity", "medium", "gravcomp", "armature", "damping", "friction", "stiffness", "rest")
#: Library that does not use a property -> case of the casebook.
CASES = {
    ("pinocchio", "gravity"): "pin-mjcf-gravity",
    ("pinocchio", "gravcomp"): "pin-mjcf-gravcomp",
    ("pinocchio", "stiffness"): "pin-mjcf-springs",
    ("pinocchio", "rest"): "pin-mjcf-springs",
}


def one_file(models: tuple[Model, Model]) -> bool:
    """Whether both sides are the same file."""
    return models[0].file is not None and models[0].file == models[1].file


def unused(models: tuple[Model, Model], found: Sequence[Difference]) -> Iterator[str]:
    """Of one file: what one library reads and the other leaves as if the file did not say it; a sentence each."""
    for k, model in enumerate(models if one_file(models) else ()):
        whats = [each.what for each in found if each.what in _OPTIONAL and _left_out((each.a, each.b), k, each.what)]
        if whats:
            names = ", ".join(dict.fromkeys(NAMES.get(what, what) for what in whats))
            cases = dict.fromkeys(CASES[key] for what in whats if (key := (model.library, what)) in CASES)
            book = f" (casebook: {', '.join(cases)})" if cases else ""
            yield f"{model.library} does not use what the file says of {names}{book}."


def _left_out(values: tuple[object, object], k: int, what: str) -> bool:
    """Whether one value is that of a file that does not say it, and the other one is not."""
    default = _DEFAULTS.get(what, np.zeros(PROPERTIES[what].shape))
    plain = [value is not None and np.array_equal(np.asarray(value), default) for value in values]
    return plain[k] and not plain[1 - k]
