"""Which library does not use what, where two read one file, and the case of the casebook that shows it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from screwgauge.casebook.book import reproduce
from screwgauge.diagnosis.differences.difference import Difference
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.properties import OPTIONAL, PROPERTIES, ROOMS, Change, word
from screwgauge.models.readings.reading import Reading

#: Case of tensors that MuJoCo's compiler turns inexactly, and more than it changes of them.
AXES, INEXACT = "mj-axes-before-3.14", 1e-6


def compiled(models: tuple[Model, Model], found: Sequence[Difference]) -> list[Difference]:
    """The differences, those of tensors marked that are no larger than what the installed MuJoCo makes of a file."""
    small = [each.what == "inertia" and each.kind == "model" and each.size <= INEXACT for each in found]
    readers = {model.library for model in models}
    if not any(small) or "mujoco" not in readers or reproduce(AXES).status != "shown":
        return list(found)
    why = f"as MuJoCo compiles it (casebook: {AXES})"
    return [
        replace(each, kind="digits", sentence=f"{each.sentence}: {why}") if of_it else each
        for each, of_it in zip(found, small, strict=True)
    ]


def one_file(models: tuple[Model, Model]) -> bool:
    """Whether both sides are the same file."""
    return models[0].file is not None and models[0].file == models[1].file


def unused(models: tuple[Model, Model], found: Sequence[Difference]) -> Iterator[str]:
    """Of one file: what one library reads and the other leaves as if the file did not say it; a sentence each."""
    for k, model in enumerate(models if one_file(models) else ()):
        whats = [each.what for each in found if each.what in OPTIONAL and _left_out((each.a, each.b), k, each.what)]
        if whats:
            yield does_not_use(model.library, whats)


def does_not_use(library: str, whats: Sequence[str]) -> str:
    """A sentence on properties that a library leaves in a file."""
    names = ", ".join(dict.fromkeys(word(what) for what in whats))
    cases = dict.fromkeys(filter(None, (PROPERTIES[what].cases.get(library) for what in whats)))
    book = f" (casebook: {', '.join(cases)})" if cases else ""
    return f"{library} does not use what the file says of {names}{book}."


def unheard(change: Change, before: Reading, after: Reading) -> bool:
    """Whether a library reads the same as before from a file that has the change."""
    owner = PROPERTIES[change.what].owner
    if change.what not in OPTIONAL or (owner != "model" and change.item not in getattr(after, ROOMS[owner])):
        return False
    holders = [r if owner == "model" else getattr(r, ROOMS[owner])[change.item] for r in (before, after)]
    old, new = (np.asarray(getattr(holder, change.what), dtype=float) for holder in holders)
    return np.array_equal(old, new) and not np.array_equal(new, change.value)


def _left_out(values: tuple[object, object], k: int, what: str) -> bool:
    """Whether one value is that of a file that does not say it, and the other one is not."""
    default = np.broadcast_to(PROPERTIES[what].default or 0.0, PROPERTIES[what].shape or ())
    plain = [value is not None and np.array_equal(np.asarray(value), default) for value in values]
    return plain[k] and not plain[1 - k]
