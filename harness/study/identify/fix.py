"""Output of identified numbers: as a description, or into the model file from which the scene was made."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from screwgauge.models.importing.model import description
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.outputs import save_file
from screwgauge.study.identify.run import Identification


def check_fix(out: Path, model: Path | None, data: Path | None) -> None:
    """Reject, before any work, a file to which numbers cannot be written.

    Raises:
        DescriptionError: There are no data, or the scene was not made from a model file with this extension.
    """
    if data is None:
        raise DescriptionError("there are no measured forces", "identify, --fix", "pass a file of forces with --data")
    if out.suffix != ".toml" and (model is None or model.suffix != out.suffix):
        what = f"{out.name} is neither a description nor a copy of the scene's model file"
        raise DescriptionError(
            what, "identify, --fix", "choose a name that ends in .toml, or pass the model file as SCENE"
        )


def write_fix(found: Identification, out: Path, model: Path | None, *, force: bool = False) -> Iterator[str]:
    """Write the most likely numbers; yield a sentence on the file, and on each number that could not be written.

    A model file is corrected as in ``diagnose``: only differences from the identified machine are written.

    Raises:
        ScrewgaugeError: The file cannot be written.
    """
    text = description(found.mechanism, ["Identified numbers: masses, inertias, rotors, damping and friction."])
    if out.suffix == ".toml" or model is None:
        save_file(out, text, force=force)
        yield f"fixed: {out}"
        return
    from screwgauge.diagnosis.diagnose import diagnose

    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        target = Path(folder) / "identified.toml"
        target.write_text(text, encoding="utf-8")
        diagnosis = diagnose(target, model)
        yield f"fixed: {diagnosis.write_fix(out, force=force)}"
        yield from (f"not fixed: {why}" for why in diagnosis.not_fixed)
