"""Import in a process of its own: a library that crashes or hangs on a model file does not take the command with it."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from screwgauge.models.importing.convert import Imported
from screwgauge.models.importing.model import Options, import_model
from screwgauge.problem import Progress
from screwgauge.reference.errors import ModelFileError
from screwgauge.solution import Failure
from screwgauge.study.apart import Limits, apart

#: The largest public models take a few seconds.
LIMITS = Limits(seconds=120.0)


def import_apart(path: Path, options: Options | None = None, limits: Limits = LIMITS) -> Imported:
    """What `import_model` gives.

    Raises:
        ScrewgaugeError: It is no model, or one that a description cannot hold; or whoever reads it fails.
    """
    with TemporaryDirectory() as folder:
        work = partial(_work, path, options or Options())
        found = apart({"import": work}, limits, Path(folder), lambda names, share: None)["import"]
    if isinstance(found, Failure):
        remedy = "let another library read it (--reader), or give a smaller model"
        raise ModelFileError(f"cannot be read: {found.reason}", str(path), remedy)
    return found


def _work(path: Path, options: Options, progress: Progress) -> Imported | Failure:
    return import_model(path, options)
