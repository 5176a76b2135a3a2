"""Import in a process of its own: a library that crashes or hangs on a model file does not take the command with it."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from screwgauge.models.importing.convert import Imported
from screwgauge.models.importing.model import Options, import_model
from screwgauge.reference.errors import ModelFileError
from screwgauge.solution import Failure
from screwgauge.study.apart import Limits, unwatched_apart

#: The largest public models take a few seconds.
LIMITS = Limits(seconds=120.0)


def import_apart(path: Path, options: Options | None = None) -> Imported:
    """What `import_model` gives.

    Raises:
        ScrewgaugeError: It is no model, or one that a description cannot hold; or whoever reads it fails.
    """
    found = unwatched_apart({"import": partial(import_model, path, options or Options())}, LIMITS)["import"]
    if isinstance(found, Failure):
        remedy = "let another library read it (--reader), or give a smaller model"
        raise ModelFileError(f"cannot be read: {found.reason}", str(path), remedy)
    return found
