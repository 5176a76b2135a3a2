"""Random mechanisms with motions, chosen by family and seed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from zlib import crc32

import numpy as np
import tomli_w

from screwgauge.families.placements import FAMILIES, NAMED
from screwgauge.families.sketch import Sketch, Tables, describe, draw_name, shuffle
from screwgauge.models.catalog import load_mechanism
from screwgauge.quantities import GIVEN, QUANTITIES
from screwgauge.reference.closed.assembly_mode import AssemblyMode
from screwgauge.reference.errors import ScrewgaugeError, UnknownNameError, check_seed
from screwgauge.reference.graph import layout
from screwgauge.reference.mechanism import KINDS, Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.scene.default import obstacle
from screwgauge.scene.motion import read_drive
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene

SAMPLES = 5
AMPLITUDES = (0.1, 0.2, 0.4, 0.8, 1.6)  # [rad or m] of the coordinate with the largest motion
FASTEST = 10.0  # largest rate of any coordinate per unit rate of the independent or actuated coordinates
POSES = 41  # number of samples at which a motion is checked


def families() -> list[str]:
    """Return the names of the families."""
    return sorted(FAMILIES)


@cache
def _folder() -> TemporaryDirectory[str]:
    """Create a temporary directory, deleted when the process ends."""
    return TemporaryDirectory(prefix="screwgauge-random-")


def random(seed: int, family: str | None = None, folder: Path | None = None) -> Scene:
    """Draw a random mechanism with a random motion away from singular poses.

    At a singular pose the independent coordinates do not determine the motion; the motion may still pass poses at which
    the actuators do not determine it. Lengths are about 1 m, masses about 1 kg, times within 1 s. Frames, inertias,
    names, loads, the direction of gravity, the order of all entries and the direction of every joint are also random.

    Args:
        seed: Random seed; the same seed gives the same mechanism.
        family: One of `families()`; by default the seed chooses among the families common to all versions.
        folder: Directory for the TOML files of description and scene, which any command can read; by default they
            are deleted when the process ends.

    Raises:
        ScrewgaugeError: The family is unknown, or the seed is invalid.
    """
    check_seed(seed)
    names = families()
    chosen = [name for name in names if name not in NAMED]
    family = family or chosen[np.random.default_rng(seed).integers(len(chosen))]
    if family not in FAMILIES:
        raise UnknownNameError("family", family, names)
    folder = Path(_folder().name) if folder is None else folder
    folder.mkdir(parents=True, exist_ok=True)
    for draw in range(1000):
        rng = np.random.default_rng([seed, crc32(family.encode()), draw])
        if drawn := _draw(rng, family, folder / f"{family}-{seed}.toml", draw):
            return drawn
    raise RuntimeError(f"1000 draws of {family} with seed {seed} gave no mechanism away from singular poses")


def _draw(rng: np.random.Generator, family: str, file: Path, redrawn: int) -> Scene | None:
    """Draw once; return None unless the mechanism is well conditioned at and near its home pose."""
    sketch = Sketch(rng)
    FAMILIES[family](sketch)
    sketch.flip()
    if (K := sketch.freedoms()) is None:
        return None
    freedoms = K.shape[1]
    chosen = pick(rng, K, range(len(K)))
    driven = _drive(sketch, K)
    strong = np.linalg.matrix_rank(K[driven], 1e-9) == freedoms
    if len(chosen) < freedoms or max(gain(K, chosen), gain(K, driven) if strong else 0.0) > FASTEST:
        return None
    tables, coordinates = describe(sketch, file.stem)
    flat, used = [name for names in coordinates for name in names], set[str]()
    independent = {draw_name(rng, used, ("_",)): flat[i] for i in chosen}
    file.write_text(tomli_w.dumps({**tables, "independent": independent}), encoding="utf-8")
    mechanism = load_mechanism(file)
    motion = _motion(rng, mechanism, gain(K, chosen))
    if motion is None:
        return None
    scene = {
        "description": f"Random mechanism of the family {family}, after {redrawn} draws too near a singular pose.",
        "mechanism": file.name,
        "gravity": (9.81 * sketch.unit()).tolist(),
        "motion": motion,
        "time": {"times": np.sort(rng.uniform(0.0, 1.0, SAMPLES)).tolist()},
        "loads": [_load(sketch, mechanism)] if rng.random() < 0.5 else [],
    }
    if not strong:  # fewer actuators than degrees of freedom
        scene["quantities"] = [name for name in GIVEN if not QUANTITIES[name].ruled]
    path = file.with_name(f"{file.stem}-scene.toml")
    path.write_text(tomli_w.dumps(scene), encoding="utf-8")
    return load_scene(path)


def pick(rng: np.random.Generator, K: Array, rows: Iterable[int]) -> list[int]:
    """Choose random, clearly independent rows of a matrix, as many as its rank. Shape (n, k)."""
    rest, chosen, order = K.copy(), list[int](), rng.permutation(list(rows)).astype(int)
    while len(chosen) < K.shape[1] and len(order):
        sizes = np.linalg.norm(rest[order], axis=1)
        if sizes.max() < 1e-6:
            break
        chosen.append(int(order[np.argmax(sizes > 0.5 * sizes.max())]))
        along = rest[chosen[-1]] / np.linalg.norm(rest[chosen[-1]])
        rest = rest - np.outer(rest @ along, along)
    return chosen


def gain(K: Array, rows: list[int]) -> float:
    """Return the largest rate of any coordinate per unit rate of the coordinates in `rows`. Shape (n, k)."""
    return float(np.abs(K @ np.linalg.pinv(K[rows])).max())


def _drive(sketch: Sketch, K: Array) -> list[int]:
    """Actuate the family's driven R and P joints, else random joints: one per degree of freedom, sometimes one more.

    Returns:
        Rows of the actuated coordinates.
    """
    first = sketch.firsts
    rows = {first[i]: joint for i, joint in enumerate(sketch.joints) if len(KINDS[joint.kind]) == 1}
    driven = [row for row, joint in rows.items() if joint.driven] or pick(sketch.rng, K, rows)
    if len(rows) > len(driven) and sketch.rng.random() < 0.15:
        driven.append(int(sketch.rng.choice([row for row in rows if row not in driven])))
    for row in driven:
        i = int(np.searchsorted(first, row))
        sketch.joints[i] = replace(sketch.joints[i], driven=True)
    return driven


def _motion(rng: np.random.Generator, mechanism: Mechanism, fastest: float) -> Tables | None:
    """Draw a few sines about the home pose, as large as possible with all poses well conditioned."""
    home = mechanism.home[mechanism.independent_columns]
    sines = [rng.normal(size=(2, 3)) for _ in home]
    mode = AssemblyMode(layout(mechanism), strict=True)
    largest: Tables | None = None
    for amplitude in AMPLITUDES:
        motion: Tables = {}
        for label, value, (a, b) in zip(mechanism.independent, home, sines, strict=True):
            size = amplitude / fastest / (np.hypot(*a[1:]) + np.hypot(*b[1:]))
            rows = [[1.0 + 2.0 * abs(row[0]), size * row[1], size * row[2]] for row in (a, b)]
            motion[label] = {"offset": float(value), "harmonics": np.array(rows).tolist()}
        try:
            drive = read_drive(motion, list(mechanism.independent), Path(), "motion")[0]
            if obstacle(mode, drive(np.linspace(0.0, 1.0, POSES)), POSES):
                break
        except ScrewgaugeError:  # the motion leads to a singular pose, or the loops do not close
            break
        largest = motion
    return largest and shuffle(rng, largest)


def _load(sketch: Sketch, mechanism: Mechanism) -> Tables:
    force, torque, point = 5.0 * sketch.unit(), sketch.unit(), 0.2 * sketch.rng.normal(size=3)
    body = mechanism.bodies[sketch.rng.integers(len(mechanism.bodies))].name
    vectors = {"point": point.tolist(), "force": force.tolist(), "torque": torque.tolist()}
    return {"on": body, "by": "environment", **vectors}
