"""Generated scenes: exciting motions, and default scenes for descriptions and model files as TOML.

A persistently exciting motion is a sum of sines for every independent coordinate, as large as limits and singular poses
allow, and so fast that inertial forces are about as large as gravity and loads. Module `read` reads scenes from files.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from screwgauge.models.catalog import load_mechanism
from screwgauge.models.formats import key, lines
from screwgauge.models.home import check_home
from screwgauge.models.importing import is_model
from screwgauge.models.importing.model import Imported, Options, description, notes
from screwgauge.problem import GivenMotion
from screwgauge.quantities import G0, GIVEN
from screwgauge.reference import linear
from screwgauge.reference.applied import Applied, JointSpring
from screwgauge.reference.closed.assembly_mode import AssemblyMode
from screwgauge.reference.closed.continuation import PathEnd
from screwgauge.reference.closed.loops import loop_equations
from screwgauge.reference.closed_motion import ClosedMotion, motion_at
from screwgauge.reference.errors import DescriptionError, OutputError, ScrewgaugeError, check_seed, first_few
from screwgauge.reference.expressions import vector
from screwgauge.reference.files import is_file, is_path, named_file
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.outputs import check_free, stamp
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import read_toml
from screwgauge.scene.idle import Followed
from screwgauge.scene.motion import Drive, read_drive
from screwgauge.scene.preflight import limits_left
from screwgauge.scene.scene import DEFAULT_ENGINES, RULES, Scene, check_scene_type

CLOSEST = 1e2  # multiple of |J^-1| at home beyond which a motion is not followed closer to a singular pose
SINGULAR = "it would approach a singular pose"
WORSE = 4.0  # largest acceptable ratio of a condition number to that of the home pose
STEEPEST = 1.2  # largest second angle of an S joint [rad], well before its lock
#: Amplitudes of the coordinate that moves most [rad or lengths of the mechanism]; the first suitable one is used.
AMPLITUDES = 0.64 / 2.0 ** (np.arange(13) / 2)
SINES = 3  # number of sines for each coordinate
SAMPLES = 101
NAMED = 4  # number of joints named in a sentence
PART = 12  # number of samples tracked before screening
PERIODS = 2.0 * SINES  # number of periods at the usual frequency, equal to two periods of the slowest sine


def obstacle(mode: AssemblyMode, motion: GivenMotion, part: int = PART) -> str:
    """Describe the obstacle to a motion from home: limits, or poses much worse conditioned than home; empty if none.

    Args:
        mode: Assembly mode that follows the motion strictly, and reuses poses that it has followed before.
        part: Number of samples tracked before screening; a small number saves long searches for the end of a path.

    Raises:
        ScrewgaugeError: The motion cannot be followed.
    """
    lay, mechanism = mode.lay, mode.lay.mechanism
    system, balls = loop_equations(lay), [j for j in mechanism.joints if j.constrains and j.angles == 3]
    middle = [joint.coordinates[1] for joint in balls]
    mode.restart()
    mode.avoid_singular(CLOSEST)
    for first in range(0, len(motion), part):
        some = motion.part(slice(first, first + part))
        closed = mode.motion(some.y, some.t, (some.yd, some.ydd), some.drive)
        q = np.vstack([mechanism.home, closed])
        worst, steep = linear.condition(system.matrix(q)), np.abs(q[:, mechanism.columns(tuple(middle))])
        inside = (worst < WORSE * worst[0]).all() and (steep < np.maximum(STEEPEST, (steep[0] + np.pi / 2) / 2)).all()
        if beyond := limits_left(mechanism, closed):
            return f"it would exceed the limits of {first_few(beyond, NAMED)}"
        if not inside:
            return SINGULAR
    return ""


def exciting(scene: Scene, seed: int = 0, samples: int = SAMPLES, largest: float = AMPLITUDES[0]) -> Scene:
    """Return a copy of the scene with new times and a motion from home that excites as much inertia as possible.

    Args:
        seed: Seed of the motion; part of the scene's name and title.
        samples: Number of samples; `SAMPLES` samples cover the whole motion.
        largest: Amplitude to try first [rad or lengths of the mechanism].

    Raises:
        DescriptionError: The motion of the scene is integrated, or the mechanism has no room to move about its home
            pose.
        ScrewgaugeError: The mechanism is invalid.
    """
    check_scene_type(scene, "exciting")
    check_seed(seed)
    if scene.simulated:
        what = "an exciting motion can only replace a given motion, but the motion of this scene is integrated"
        raise DescriptionError(what, scene.name, "run the scene with its own motion")
    if scene.tables:
        raise DescriptionError(
            "tables hold values of the scene's motion, which an exciting motion would replace",
            scene.name,
            "run the scene with its own motion",
        )
    if any(load.sampled for load in scene.applied.loads):
        what = "a load is sampled at the times of its file, which an exciting motion would replace"
        raise DescriptionError(what, scene.name, "run the scene with its own motion")
    mechanism, lay = scene.mechanism, check_home(scene.mechanism)
    columns = mechanism.independent_columns
    at = motion_at(lay, mechanism.home[None], np.zeros((1, len(columns))))
    size = loop_equations(lay).sizes
    heights = size[columns] / (SINES * np.abs(at.joint_map[0] / size[:, None] * size[columns]).max(axis=0))
    heights = np.minimum(heights, _room(mechanism) / (SINES * AMPLITUDES[0]))
    sines, pace = _sines(np.random.default_rng(seed), heights), _pace(at, scene.applied, heights)
    stopped, mode = "", AssemblyMode(lay, strict=True)
    labels = scene.drive.labels if isinstance(scene.drive, Followed) else tuple(mechanism.independent)
    for amplitude in AMPLITUDES[largest >= AMPLITUDES]:
        omega = pace / np.sqrt(amplitude)
        tables = {
            label: {"offset": f"{home:.9g}", "harmonics": [[f"{x:.6g}" for x in row] for row in rows]}
            for label, home, rows in zip(
                mechanism.independent, mechanism.home[columns], sines * [omega, amplitude, amplitude], strict=True
            )
            if label in labels
        }
        step = float(f"{PERIODS * 2.0 * np.pi / omega / (SAMPLES - 1):.2g}")
        drive, t = (
            _complete_drive(scene, read_drive(tables, [*labels], Path(), "motion")[0]),
            step * np.arange(float(samples)),
        )
        try:
            stopped = obstacle(mode, drive(t))
        except PathEnd as end:
            stopped = SINGULAR if end.beyond else end.what
        except ScrewgaugeError as error:
            stopped = error.what
        if not stopped:
            return _replace_motion(scene, seed, tables, drive, t)
    least = f"{AMPLITUDES[-1]:.1g} (rad or lengths of the mechanism)"
    what = f"not even a motion of {least} about home stays within the limits and away from singular poses: {stopped}"
    raise DescriptionError(what, mechanism.where, "widen the limits, or choose another home pose")


def _complete_drive(scene: Scene, given: Drive) -> Drive | Followed:
    """Complete a given motion with the coordinates that no actuator drives."""
    return replace(scene.drive, given=given, since=0.0) if isinstance(scene.drive, Followed) else given


def _room(mechanism: Mechanism) -> Array:
    """Return each independent coordinate's distance from its limits at home [rad or m], inf outside. Shape (k,)."""
    columns = mechanism.independent_columns
    low, high = mechanism.limits[columns].T
    room = np.minimum(mechanism.home[columns] - low, high - mechanism.home[columns])
    return np.where(room > 0.0, room, np.inf)


def _replace_motion(scene: Scene, seed: int, tables: dict[str, Any], drive: Drive | Followed, t: Array) -> Scene:
    return replace(
        scene,
        name=f"{scene.name}-exciting-{seed}",
        title=f"{scene.title}, exciting motion with seed {seed}",
        description=f"{scene.description} An exciting motion (seed {seed}) replaces the given motion.",
        task=drive(t),
        drive=drive,
        text={**scene.text, "motion": tables},
    )


def _sines(rng: np.random.Generator, heights: Array) -> Array:
    """Draw sines [omega, cos, sin] for each coordinate: distinct frequencies, random phases, and sum 0 at t = 0."""
    sines = np.empty((len(heights), SINES, 3))
    for rows, height in zip(sines, heights, strict=True):
        cos = np.full(SINES, 2.0)
        while abs(cos[-1]) > 1.0:
            cos = np.cos(rng.uniform(0.0, 2.0 * np.pi, SINES))
            cos[-1] = -cos[:-1].sum()
        sin = np.sqrt(1.0 - cos**2) * rng.choice([-1.0, 1.0], SINES)
        omega = (1.0 + np.arange(SINES) + rng.uniform(0.0, 0.9, SINES)) / SINES
        rows[:] = np.stack([omega, height * cos, height * sin], axis=1)
    return sines


def _pace(at: ClosedMotion, applied: Applied, heights: Array) -> float:
    """Return the frequency [rad/s] at which inertial forces of a motion are about as large as gravity and loads."""
    mechanism, index = at.mechanism, at.mechanism.body_index
    inertia = float((heights**2 * np.diagonal(at.inertia_matrix[0])).sum())
    v, w = (np.linalg.norm(part[0], axis=2).T @ heights for part in at.partial_motion)
    acting = np.linalg.norm(applied.g) * mechanism.masses @ v
    for load in (each.at(0.0) for each in applied.loads):
        i = index[load.body] - 1
        acting += np.linalg.norm(load.force) * v[i] + np.linalg.norm(load.torque) * w[i]
    return float(np.sqrt(acting / inertia if acting * inertia > 0.0 else G0 / at.loops.length))


#: Suffix of the scene file of a description: ``panda.toml`` has ``panda.scene.toml``.
SUFFIX = ".scene.toml"


def scene_file(path: Path) -> Path:
    """Return the scene file for a path: the path itself, or the scene of a description or model file.

    A model file, or a description without a scene in its folder, gets the default scene, in a folder removed at the end
    of the process.

    Raises:
        ScrewgaugeError: The file cannot be read, or no scene can be made from it.
    """
    from screwgauge.models.importing.model import imported_file, scratch_folder

    if is_model(path):
        description, imported = imported_file(path)
        acting = acting_on(imported)
    else:
        tables = read_toml(path)
        if "mechanism" in tables or not {"bodies", "joints", "extends"} & tables.keys():
            return path
        scene = path.with_name(f"{path.stem}{SUFFIX}")
        if is_file(scene):
            return scene
        description, acting = path.resolve(), dict[str, Any]()
    file = scratch_folder() / f"{path.stem}{SUFFIX}"
    mechanism = replace(load_mechanism(description), where=str(path))  # errors must name the user's file
    file.write_text(default_scene(mechanism, description, **acting), encoding="utf-8")
    return file


def gravity_of(name: str) -> Array | None:
    """Return the gravity of a model file, or of the scene next to a description.

    Returns:
        Vector in world axes [m/s^2], shape (3,); None if the file does not specify gravity.
    """
    from screwgauge.models.importing.model import imported_file

    path = named_file(Path(), name)
    if is_model(path):
        return imported_file(path)[1].gravity
    file = path.with_name(f"{path.stem}{SUFFIX}")
    gravity = read_toml(file).get("gravity") if is_path(name) and is_file(file) else None
    return None if gravity is None else vector(gravity, f"{file}, gravity")


def acting_on(imported: Imported) -> dict[str, Any]:
    """Return the arguments of `default_scene` that a model file determines in addition to the mechanism."""
    from screwgauge.models.importing.model import notes

    return {"gravity": imported.gravity, "springs": imported.springs, "description": " ".join(notes(imported))}


def default_scene(
    mechanism: Mechanism,
    file: Path,
    *,
    gravity: Array | None = None,
    springs: Sequence[JointSpring] = (),
    description: str = "",
) -> str:
    """Return the default scene of a mechanism as TOML.

    Args:
        file: Path of the description, absolute or relative to the scene.
        gravity: Vector in world axes [m/s^2]; standard gravity by default. Shape (3,).
        springs: Springs and dampers of joints.

    Raises:
        ScrewgaugeError: The mechanism is invalid, or has no room to move.
    """
    scene = exciting(_at_rest(mechanism, file, Applied(gravity=gravity, springs=tuple(springs))))
    out = [f"# {wrap(description, 116)[0]}"] if description else []
    out += lines({"mechanism": str(file), "description": f"{description} {scene.description.strip()}".strip()})
    if gravity is not None:
        out += lines({"gravity": gravity})
    step = float(scene.t[1] - scene.t[0])
    out += ["", "[time]", *lines({"duration": float(f"{scene.t[-1]:.9g}"), "step": step})]
    for label, table in scene.text["motion"].items():
        rows = ", ".join(f"[{', '.join(row)}]" for row in table["harmonics"])
        out += ["", f"[motion.{key(label)}]", f"offset = {table['offset']}", f"harmonics = [{rows}]"]
    for spring in springs:
        entries = {"coordinate": spring.coordinate, "stiffness": spring.stiffness, "rest": spring.rest}
        out += ["", "[[springs]]", *lines(entries)]
    return "\n".join(out) + "\n"


def _at_rest(mechanism: Mechanism, file: Path, applied: Applied) -> Scene:
    home = mechanism.home[mechanism.independent_columns][None]
    none = np.zeros_like(home)
    return Scene(
        name=mechanism.name,
        title=mechanism.title,
        description="",
        mechanism=mechanism,
        mechanism_file=file,
        applied=applied,
        task=GivenMotion(np.zeros(1), home, none, none),
        rule=RULES[0],
        engines=DEFAULT_ENGINES,
        quantities=GIVEN,
        tolerances={},
        models={},
        figures=(),
    )


def write_model(model: Any, constraints: Sequence[Any], q: ArrayLike | None, options: Options) -> Path:
    """Write the scene of a Pinocchio model to a temporary folder; see `screwgauge.import_model`.

    Raises:
        ScrewgaugeError: `model` is not a Pinocchio model, or no scene can be made from it.
    """
    from screwgauge.models.importing.left_out import left_out_of_model
    from screwgauge.models.importing.model import describe, scratch_folder
    from screwgauge.models.readings.built import read_model

    where = "import_model"
    reading = read_model(model, constraints, None if q is None else np.asarray(q), where)
    imported = describe(reading, where, options, beyond=left_out_of_model(reading, where))
    return write_imported(imported, scratch_folder() / f"{imported.mechanism.name}.toml")[1]


def write_imported(imported: Imported, file: Path, text: str = "", *, force: bool = False) -> tuple[Path, Path]:
    """Write the description and its scene into one folder.

    Args:
        text: Content of the description; generated from the mechanism by default.
        force: Replace existing files, whatever their origin.

    Returns:
        The paths of the description and the scene.

    Raises:
        OutputError: A file cannot be written, or an existing file was edited or was not written by this program.
        ScrewgaugeError: No scene can be made.
    """
    if file.suffix != ".toml":
        raise OutputError("is not a file name for a description", str(file), "choose a name that ends in .toml")
    scene = file.with_name(f"{file.stem}{SUFFIX}")
    for path in (file, scene):
        check_free(path, force=force)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=file.parent, prefix=".import-") as folder:
            made = Path(folder) / file.name, Path(folder) / scene.name
            _write(made[0], text or description(imported.mechanism, notes(imported)))
            # use the numbers as they will be read, to the last digit; errors must name the imported file
            mechanism = replace(load_mechanism(made[0]), where=imported.mechanism.where)
            _write(made[1], default_scene(mechanism, Path(file.name), **acting_on(imported)))
            for path, target in zip(made, (file, scene), strict=True):
                os.replace(path, target)
    except OSError as error:
        raise OutputError(f"cannot be written ({error.strerror})", str(file), "choose another file") from None
    return file, scene


def _write(path: Path, text: str) -> None:
    path.write_text(stamp(text), encoding="utf-8")
