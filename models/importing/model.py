"""Imports model files as mechanisms and writes them as descriptions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import wrap

import numpy as np

from screwgauge.models.files.loops import OWN, LoopsFile, read_loops
from screwgauge.models.files.parts import files_allowed
from screwgauge.models.formats import body_entries, document, joint_entries, key, lines
from screwgauge.models.importing import MESHES
from screwgauge.models.importing.assemble import assemble, choose
from screwgauge.models.importing.couplings import solve_couplings
from screwgauge.models.importing.joints import Group, few_names, graph_of, groups, joint, left_out, pin_name, springs_of
from screwgauge.models.importing.left_out import check_whole, convert, left_out_of, with_resistance
from screwgauge.models.importing.names import TAKEN, accept_names, free_name
from screwgauge.models.machine import Body as RigidBody
from screwgauge.models.machine import Machine
from screwgauge.models.readings.anchors import points_off_bodies
from screwgauge.models.readings.compiled import collect_warnings
from screwgauge.models.readings.loops import loops_for, with_loops
from screwgauge.models.readings.mujoco import is_single, load_mujoco
from screwgauge.models.readings.read import dropped_parts, libraries_of, read_source
from screwgauge.models.readings.reading import CouplingReading, Reading, rename
from screwgauge.models.readings.source import Source, prepare
from screwgauge.reference.applied import JointSpring
from screwgauge.reference.couplings import Coupling
from screwgauge.reference.errors import DescriptionError, ModelFileError, UnknownNameError
from screwgauge.reference.files import check_count, digest, files_read, is_file
from screwgauge.reference.inertia import TRIANGLE, settle_tensors
from screwgauge.reference.left_out import LeftOut, entries
from screwgauge.reference.lint import implausible
from screwgauge.reference.mechanism import GROUND, Body, Joint, Mechanism
from screwgauge.reference.rotations import Array


def description(mechanism: Mechanism, remarks: Sequence[str] = ()) -> str:
    """Write a mechanism as a description in TOML.

    Args:
        remarks: Sentences to write above the description as comments.
    """
    out = [f"# {line}" for remark in remarks for line in wrap(remark, 116)]
    head = {"name": mechanism.name, "title": mechanism.title, "source": mechanism.source, "group": mechanism.group}
    out += lines(
        {name: value for name, value in {**head, "allow": tuple(sorted(_entries(mechanism)))}.items() if value}
    )
    parts = [(f"[bodies.{key(body.name)}]", body_entries(body)) for body in mechanism.bodies]
    parts += [(f"[joints.{key(joint.name)}]", joint_entries(joint)) for joint in mechanism.joints]
    left_out = [("[[left_out]]", entries(one)) for one in mechanism.left_out]
    return document(out, mechanism, parts, left_out)


#: Rounding error that merging links leaves in zero moments of inertia, relative to mass times squared model length.
ROUNDING = 1e-16


@dataclass(frozen=True, slots=True, eq=False)
class Imported:
    """A mechanism made from a reading.

    Attributes:
        springs: Springs of the joints, which belong to the scene.
        gravity: Gravity in world axes [m/s^2], shape (3,); None if the file does not define it.
        names: Name in the file -> name in the description, where they differ.
        remarks: Sentences on how the mechanism was made.
        left_out: Phrases on content of the file that neither the description nor the scene contains.
    """

    mechanism: Mechanism
    springs: tuple[JointSpring, ...]
    gravity: Array | None
    names: Mapping[str, str]
    remarks: tuple[str, ...]
    left_out: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Options:
    """Options of an import.

    Attributes:
        loops: File that closes the loops of a URDF; by default, see `readings.loops.loops_for`.
        library: Library that reads the file; by default, the first library for its format.
        floating: Give a URDF a floating base.
        meshes: Compute mass and inertia from meshes in the folder of an MJCF if the model derives them from meshes.
        independent, actuated: Label -> independent coordinate, and actuated joints; if None, the file determines them.
        allow: Physically impossible tensors to accept, such as ``wrist.triangle``; files and folders to which the model
            file may refer, as paths relative to its folder that contain ``/``; and `MESHES`.
    """

    loops: Path | None = None
    library: str = ""
    floating: bool = False
    meshes: bool = False
    independent: Mapping[str, str] | None = None
    actuated: Sequence[str] | None = None
    allow: Sequence[str] = ()

    @property
    def tensors(self) -> list[str]:
        """Names of the allowed tensors."""
        return [entry for entry in self.allow if entry != MESHES and "/" not in entry]

    def with_choices_of(self, own: LoopsFile) -> Options:
        """Fill in, from a loops file, the choices that the user left open."""
        driven = [joint.coordinates[0] for joint in own.joints if joint.actuated]
        chosen = own.independent if self.independent is None else self.independent
        return replace(self, independent=chosen, actuated=driven if self.actuated is None else self.actuated)


def describe(
    reading: Reading,
    where: str,
    options: Options,
    given: Sequence[Joint] = (),
    keyframes: Mapping[str, Mapping[str, float]] | None = None,
    beyond: Sequence[LeftOut] = (),
) -> Imported:
    """Build a mechanism from a reading.

    Args:
        where: Name of the file, for error messages.
        given: Known loop-closing joints; all other loop-closing joints are derived from coinciding points.
        keyframes: Poses that may be near a good home pose: name -> joint -> coordinate [rad or m].
        beyond: Further forces of the file, named as in the file.

    Raises:
        ScrewgaugeError: The model cannot move, its loops do not close, or an option is unsuitable for the model.
    """
    own, tables = _rename(reading)
    names = {old: new for table in tables.values() for old, new in table.items() if old != new}
    poses = {key: {names.get(name, name): x for name, x in q.items()} for key, q in (keyframes or {}).items()}
    reading, moves = assemble(own, where, poses)
    graph = graph_of(reading)
    if not any(link.articulated for link in graph.links):
        said = " ".join(graph.remarks)
        raise DescriptionError(
            f"has no degree of freedom ({said})", where, "add mass to a moving body, or free a joint"
        )
    actuated = _driven_joints(graph, options.actuated, where)
    moved = any(joint.home != own.joints[name].home for name, joint in reading.joints.items())
    leading = {*(actuated or ()), *(options.independent or {}).values()}
    couplings, followers = solve_couplings(graph.reading.couplings, leading)
    graph = replace(graph, reading=replace(graph.reading, couplings=couplings))
    known = {} if moved else {one.name: one for one in given}  # their coordinates are measured from the file's home
    mechanism, composites = _mechanism(graph, frozenset(actuated or ()), known, options.tensors, where)
    names |= {reading.name: mechanism.name} if reading.name != mechanism.name else {}
    mechanism, odd_choices = choose(mechanism, actuated, options.independent, where)
    mechanism, gears = with_resistance(mechanism, convert(beyond, mechanism, graph, tables, where), reading.actuators)
    odd = (f"Check this: {sentence}." for sentence in implausible(mechanism))
    remarks = [*moves, *graph.remarks, *followers, *composites, *odd_choices, *gears, *odd]
    if not reading.actuators and options.actuated is None:
        open_chain = "every hinge and slide of the open chain that does not depend on another joint"
        rule = "every independent hinge and slide" if reading.closures else open_chain
        driven = few_names(joint.name for joint in mechanism.actuators) or "none"
        remarks.append(f"The file has no actuators: {rule} is driven ({driven}); choose other joints with --actuated.")
    return Imported(
        mechanism, springs_of(reading, mechanism), reading.gravity, names, tuple(remarks), left_out(reading, mechanism)
    )


def _mechanism(
    graph: Machine, driven: frozenset[str], known: Mapping[str, Joint], allow: Sequence[str], where: str
) -> tuple[Mechanism, list[str]]:
    """Build the mechanism without independent coordinates and actuators; report content that it cannot represent."""
    reading = graph.reading
    joints, carriers, remarks = _joints(graph, driven, known)
    solid = [_body(name, body, graph.length, where) for name, body in graph.bodies.items() if name != GROUND]
    for count, what in ((len(solid) + len(carriers), "bodies"), (len(joints), "joints")):
        check_count(count, what, where)
    left = {name for link in graph.links for name in link.joints}
    couplings = tuple(_coupling(n, entry, where) for n, entry in reading.couplings.items() if entry.joint in left)
    bodies, sentences = settle_tensors((*solid, *carriers), joints, couplings, allow, where)
    remarks += (f"{sentence[0].upper()}{sentence[1:]}." for sentence in sentences)
    mechanism = Mechanism(
        name=accept_names([reading.name], "model")[reading.name],
        bodies=bodies,
        joints=joints,
        independent={},
        title=reading.name,
        group="imported",
        where=where,
        couplings=couplings,
    )
    if not mechanism.mass:
        raise DescriptionError("no moving body has mass", where, "add mass to at least one moving body")
    return mechanism, remarks


def _rename(reading: Reading) -> tuple[Reading, dict[str, dict[str, str]]]:
    """Give the parts of a reading names that a description accepts; also return namespace -> name -> accepted name."""
    joints = accept_names(reading.joints, "joint")
    names = {
        "bodies": accept_names(reading.bodies, "body"),
        "joints": joints,
        "closures": accept_names(reading.closures, "loop", (*TAKEN, *joints.values())),
        "couplings": accept_names(reading.couplings, "coupling"),
    }
    known = {name: entry for name, entry in reading.couplings.items() if entry.joint in joints}
    return rename(replace(reading, couplings=known), names), names


def _driven_joints(graph: Machine, chosen: Sequence[str] | None, where: str) -> list[str] | None:
    """Return the driven joints: those chosen by the user or the file, or all of an open chain; None if undetermined."""
    reading = graph.reading
    can = [name for link in graph.links for name in link.joints if reading.joints[name].kind in ("hinge", "slide")]
    if chosen is not None:
        for name in chosen:
            if name not in can:
                raise UnknownNameError("hinge or slide", name, can, f"{where}, --actuated")
        return list(chosen)
    driven = [name for name, _ in reading.actuators.values() if name in can]
    if not driven and not reading.closures:
        coupled = {coupling.joint for coupling in reading.couplings.values()}
        driven = [name for name in can if name not in coupled]
    return list(dict.fromkeys(driven)) or None


def _coupling(name: str, entry: CouplingReading, where: str) -> Coupling:
    """Build a coupling; it locks its joint if it does not depend on a moving joint."""
    return Coupling(name, entry.joint, entry.function.trimmed, f"{where}, coupling '{name}'")


def _body(name: str, body: RigidBody, length: float, where: str) -> Body:
    """Build a body without checking its tensor, see `settle_tensors`."""
    matter = body.local
    if not matter.mass:
        return Body(name, 0.0, np.zeros(3), np.zeros((3, 3)))
    inertia = 0.5 * (matter.inertia + matter.inertia.T)
    inertia[np.abs(inertia) < ROUNDING * matter.mass * length**2] = 0.0
    return Body(name, matter.mass, matter.com, inertia, f"{where}, body '{name}'", allowed=True)


def _joints(
    graph: Machine, driven: frozenset[str], given: Mapping[str, Joint]
) -> tuple[tuple[Joint, ...], list[Body], list[str]]:
    """Build all joints and the massless bodies within links; report composite joints that were divided."""
    pins = {pin_name(one.closures) for link in graph.links for one in link.elements if one.closures}
    names = {GROUND, *graph.bodies, *graph.reading.joints, *pins}
    coupled = {name for entry in graph.reading.couplings.values() for name in entry.named}
    used, carriers, joints, remarks = {*graph.reading.joints}, list[Body](), list[Joint](), list[str]()
    for link in graph.links:
        steps, divided = groups(link, graph, driven, coupled)
        remarks += divided
        near = link.near, graph.bodies[link.near].pose
        for i, group in enumerate(steps):
            far = link.far, graph.bodies[link.far].pose
            if i < len(steps) - 1:  # axes of the final body, origin in the joint
                pose = far[1].copy()
                pose[:3, 3] = group.point
                far = free_name(f"{next(iter(group.freedoms))}.carrier", names), pose
                carriers.append(Body(far[0], 0.0, np.zeros(3), np.zeros((3, 3))))
            name = group.name or _joint_name(group, used)
            known = given.get(group.name)  # of closures
            joints.append(known or joint(group, name, near, far, graph.length))
            near = far
    return tuple(joints), carriers, remarks


def _joint_name(group: Group, used: set[str]) -> str:
    """Return the name of a joint: the name of its only hinge or slide, or the common part of their names."""
    if len(group.freedoms) == 1:
        return next(iter(group.freedoms))
    parts = {name.rpartition(".")[0] for name in group.freedoms}
    whole = parts.pop() if len(parts) == 1 else ""
    return free_name(whole or "+".join(group.freedoms), used)


#: Conventional name of the home keyframe in MJCF.
HOME = "home"


def import_model(path: Path, options: Options | None = None) -> Imported:
    """Import the mechanism of a model file.

    Raises:
        ScrewgaugeError: The file is not a model, or a description cannot represent it.
    """
    options = options or Options()
    with files_allowed(path.parent, options.allow):
        return _imported_model(path, options)


def _imported_model(path: Path, options: Options) -> Imported:
    meshes = options.meshes or MESHES in options.allow
    source = prepare(path, floating=options.floating, meshes=meshes)
    library, loops = options.library or libraries_of(source.form)[0], loops_for(path, options.loops)
    own = read_loops(loops) if loops is not None and loops.name.endswith(OWN) else None
    keyframes = _keyframes(source) if own is None else {HOME: own.home}
    reading = read_source(source, library, home=keyframes.pop(HOME, None))
    if lost := dropped_parts(source, reading):
        raise ModelFileError("; ".join(each.sentence for each in lost), str(path), "read it with another library")
    check_whole(reading, source)
    reading = reading if loops is None else with_loops(reading, loops)
    beyond = left_out_of(source, reading)
    options = options if own is None else options.with_choices_of(own)
    imported = describe(reading, str(path), options, own.joints if own else (), keyframes, beyond)
    said = f"Imported from {path.name} as {library} reads it{f', with the loops of {loops.name}' if loops else ''}."
    return replace(
        imported, remarks=(said, *source.resolved, *reading.remarks, *imported.remarks, *points_off_bodies(source))
    )


def _keyframes(source: Source) -> dict[str, dict[str, float]]:
    """Return the coordinates of hinges and slides in each keyframe of an MJCF [rad or m]; number unnamed keyframes."""
    if source.form != "mjcf" or source.root.find("keyframe/key") is None:
        return {}
    with collect_warnings():
        model = load_mujoco(source)
    single = {model.joint(i).name: model.jnt_qposadr[i] for i in range(model.njnt) if is_single(model, i)}
    return {
        model.key(k).name or str(k + 1): {name: float(model.key_qpos[k][at]) for name, at in single.items()}
        for k in range(model.nkey)
    }


@cache
def _folder() -> TemporaryDirectory[str]:
    """Create a temporary folder that is deleted when the process ends."""
    return TemporaryDirectory(prefix="screwgauge-imported-")


def scratch_folder() -> Path:
    """Create a folder that is deleted when the process ends."""
    root = Path(_folder().name)
    folder = root / str(len([*root.iterdir()]))
    folder.mkdir()
    return folder


def is_scratch(path: Path) -> bool:
    """Return True for a file in a folder that is deleted when the process ends."""
    return path.is_relative_to(_folder().name)


#: Model file and flag of a floating base -> digests of the files, allowed entries, and the result of the import.
_imported: dict[tuple[Path, bool], tuple[dict[Path, str], frozenset[str], tuple[Path, Imported]]] = {}


def imported_file(path: Path, allow: Sequence[str] = (), *, floating: bool = False) -> tuple[Path, Imported]:
    """Import a model file as a description in a temporary folder; repeat the import only if the content changes.

    Args:
        allow: See `Options`; if empty, the entries of the last import of the file apply.
        floating: Give a URDF a floating base.
    """
    digests, allowed, made = _imported.get((path, floating), ({}, frozenset(), None))
    if made is None or digests != _digests([*digests], path) or not {*allow} <= allowed | _entries(made[1].mechanism):
        options = Options(floating=floating, allow=allow)
        made = keep(path, import_model(path, options), allow, floating=floating)
    return made


def _entries(mechanism: Mechanism) -> set[str]:
    """Return the entries of ``allow`` that a mechanism requires."""
    return {f"{body.name}.{TRIANGLE}" for body in mechanism.bodies if body.allowed}


def keep(path: Path, imported: Imported, allow: Sequence[str] = (), *, floating: bool = False) -> tuple[Path, Imported]:
    """Store the result of importing a model file, see `imported_file`."""
    file = scratch_folder() / f"{path.stem}.toml"
    file.write_text(description(imported.mechanism, notes(imported)), encoding="utf-8")
    with files_read() as read, files_allowed(path.parent, allow):
        prepare(path, meshes=MESHES in allow)
    made = file, imported
    _imported[path, floating] = _digests(read, path), frozenset(allow), made
    return made


def _digests(files: Sequence[Path], model: Path) -> dict[Path, str]:
    """Compute the digests of a model's files and of the loops file in its folder."""
    loops = loops_for(model)
    return {file: digest(file) if is_file(file) else "" for file in (*files, *filter(None, [loops]))}


def notes(imported: Imported) -> tuple[str, ...]:
    """Compose the comments at the top of an imported description."""
    renamed = ", ".join(f"'{old}' is '{new}'" for old, new in imported.names.items())
    left = [f"Left out: {'; '.join(imported.left_out)}."] if imported.left_out else []
    return (*imported.remarks, *([f"Names: {renamed}."] if renamed else []), *left)
