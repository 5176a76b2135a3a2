"""Pinocchio as a user calls it."""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from screwgauge.engines.toy_models import FourBar
from screwgauge.reference.rotations import Array


def load_urdf(text: str, *more: Any) -> pin.Model:
    """Loads a URDF; `more`: a root joint."""
    return pin.buildModelFromXML(text, *more)


def load_mjcf(text: str, files: Mapping[str, str] | None = None) -> pin.Model:
    """Loads an MJCF, which has to be a file.

    Args:
        files: Name -> text of files in the same folder.
    """
    with tempfile.TemporaryDirectory() as folder:
        return pin.buildModelFromMJCF(_written(Path(folder), text, files or {}))


def load_closed(text: str) -> tuple[pin.Model, Any]:
    """Loads an MJCF with what Pinocchio makes of its closures."""
    with tempfile.TemporaryDirectory() as folder:
        model, constraints, *_ = pin.buildModelAndConstraintsFromMJCF(_written(Path(folder), text, {}))
        return model, constraints


_GAPS = """
import sys, pinocchio
for file in sys.argv[1:]:
    model, constraints, *_ = pinocchio.buildModelAndConstraintsFromMJCF(file)
    first, second = constraints[0].joint1_placement, constraints[0].joint2_placement
    print(abs(first.translation - second.translation).max(), flush=True)
"""


def gaps(*texts: str) -> list[float]:
    """By how much the first closure of each MJCF is open at home, where the frames of its two joints agree [m].

    They are read in a process of its own, which Pinocchio's reader may crash: NaN from that file on.
    """
    with ExitStack() as stack:
        folders = [Path(stack.enter_context(tempfile.TemporaryDirectory())) for _ in texts]
        files = [_written(folder, text, {}) for folder, text in zip(folders, texts, strict=True)]
        done = subprocess.run([sys.executable, "-c", _GAPS, *files], capture_output=True, text=True, check=False)
    sizes = [float(line) for line in done.stdout.split()]
    return sizes + [math.nan] * (len(texts) - len(sizes))


def _written(folder: Path, text: str, files: Mapping[str, str]) -> str:
    for name, content in {"model.xml": text, **files}.items():
        (folder / name).write_text(content, encoding="utf-8")
    return str(folder / "model.xml")


def inverse(model: pin.Model, q: Any = None, v: Any = 0.0, a: Any = 0.0) -> Array:
    """Forces of `rnea`, in the neutral pose by default. Shape (n_v,)."""
    full = [np.zeros(model.nv) + x for x in (v, a)]
    q = pin.neutral(model) if q is None else np.asarray(q, dtype=float)
    return np.array(pin.rnea(model, model.createData(), q, *full))


def mass(model: pin.Model) -> float:
    """As Pinocchio adds it up [kg]."""
    return float(pin.computeTotalMass(model))


def four_bar(bar: FourBar) -> pin.Model:
    """The tree of a four-bar."""
    model = pin.Model()
    model.gravity.linear[:] = [*bar.gravity, 0.0]
    joints = [0]
    for k, (name, parent, at) in enumerate([("a", 0, (0.0, 0.0)), ("b", 1, bar.elbow), ("d", 0, bar.base)]):
        joints.append(
            model.addJoint(joints[parent], pin.JointModelRZ(), pin.SE3(np.eye(3), np.array([*at, 0.0])), name)
        )
        com = np.array([*bar.along[k] * bar.lengths[k] / 2.0, 0.0])
        inertia = pin.Inertia(bar.masses[k], com, bar.moments[k] * np.eye(3))
        model.appendBodyToJoint(joints[-1], inertia, pin.SE3.Identity())
    return model
