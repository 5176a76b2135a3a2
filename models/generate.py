"""Writes all model files of a mechanism: URDF, loops file and MJCF for both cuts."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence, Set
from functools import lru_cache
from pathlib import Path

from screwgauge.models.files.loops import write_loops
from screwgauge.models.files.robot_yaml import write_loops_yaml
from screwgauge.models.files.urdf import PART, write_urdf
from screwgauge.models.layout import CUTS
from screwgauge.models.mjcf import PARTS, write_mjcf
from screwgauge.reference.applied import GRAVITY
from screwgauge.reference.errors import OutputError, UnknownNameError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.outputs import check_free, stamp
from screwgauge.reference.rotations import Array


def stem(name: str, cut: str) -> str:
    """Return ``NAME`` for the minimal cut, ``NAME-full`` for the full cut."""
    return name if cut == "minimal" else f"{name}-{cut}"


def model_texts(
    mechanism: Mechanism, *, gravity: Sequence[float] | Array = GRAVITY, include: Set[str] = frozenset()
) -> dict[str, str]:
    """Return the text of each model file by file name.

    Args:
        gravity: Gravity in world axes [m/s^2], written to the MJCF. Shape (3,).
        include: Parts to write in addition to the mechanics: `screwgauge.models.mjcf.PARTS`, or ``yaml`` for
            `write_loops_yaml`.

    Raises:
        UnknownNameError: A part does not exist.
    """
    texts, solid = {}, include - {PART}
    for part in sorted(solid):
        if part not in PARTS:
            raise UnknownNameError("part", part, (*PARTS, PART))
    for cut in CUTS:
        name = stem(mechanism.name, cut)
        texts[f"{name}.urdf"] = write_urdf(mechanism, cut, include=include)
        texts[f"{name}.xml"] = write_mjcf(mechanism, cut, gravity=gravity, include=solid)
        texts[f"{name}.loops.toml"] = write_loops(mechanism, cut)
        if PART in include:
            texts[f"{name}.yaml"] = write_loops_yaml(mechanism, cut)
    return texts


@lru_cache(maxsize=4)  # a scene is often run several times or in parts
def _texts(mechanism: Mechanism, gravity: tuple[float, ...], include: frozenset[str]) -> dict[str, str]:
    return model_texts(mechanism, gravity=gravity, include=include)


def keep_models(
    mechanism: Mechanism,
    out: Path,
    *,
    inputs: Iterable[str | Path] = (),
    force: bool = False,
    gravity: Sequence[float] | Array = GRAVITY,
    include: Set[str] = frozenset(),
) -> list[Path]:
    """Write the model files for the user to keep; each file contains its digest.

    Args:
        inputs: Files that were read and must not be overwritten.
        force: Replace existing files, whatever their origin.

    Raises:
        OutputError: The folder cannot be written, or contains an unrelated file of the same name.
    """
    texts, inputs = model_texts(mechanism, gravity=gravity, include=include), [*inputs]
    for name in texts:
        check_free(out / name, inputs, force=force)
    return _write({name: stamp(text) for name, text in texts.items()}, out)


def write_models(
    mechanism: Mechanism, out: Path, *, gravity: Sequence[float] | Array = GRAVITY, include: Set[str] = frozenset()
) -> list[Path]:
    """Write the model files to a temporary folder, and move them to `out` only after all of them have been written.

    Raises:
        OutputError: The folder cannot be written.
    """
    return _write(_texts(mechanism, tuple(map(float, gravity)), frozenset(include)), out)


def _write(texts: Mapping[str, str], out: Path) -> list[Path]:
    try:
        out.mkdir(parents=True, exist_ok=True)
        # Inside the destination folder, each move is a single rename that cannot run out of space.
        with tempfile.TemporaryDirectory(dir=out, prefix=".models-") as folder:
            for name, text in texts.items():
                (Path(folder) / name).write_text(text, encoding="utf-8")
            for name in texts:
                os.replace(Path(folder) / name, out / name)
    except OSError as error:
        what = f"the model files cannot be written ({error.strerror})"
        raise OutputError(what, str(out), "choose a writable folder") from None
    return [out / name for name in texts]
