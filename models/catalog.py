"""Finds built-in mechanisms and descriptions by name or path, and writes the chain of N four-bars (A02)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

from screwgauge.models.importing import is_model
from screwgauge.reference.description import read_mechanism, read_tables
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.files import A_PATH, is_file, is_path, named_file
from screwgauge.reference.inertia import TRIANGLE
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.tables import read_names, read_toml

FOLDER = Path(__file__).parent


def mechanism_names() -> list[str]:
    """List the names of the built-in mechanisms."""
    return sorted(path.parent.name for path in FOLDER.glob("*/*.toml") if path.stem == path.parent.name)


def mechanism_path(
    name: str | Path, folder: Path = Path(), where: str = "", allow: Sequence[str] = (), *, floating: bool = False
) -> Path:
    """Return the path of a description, given the name of a built-in mechanism, a description file or a model file.

    Args:
        where: Location to report in errors.
        allow: Physically impossible inertia tensors to accept, in addition to the tensors that the description allows;
            for a model file, see `importing.model.Options`.
        floating: Give a URDF a floating base.

    Raises:
        DescriptionError: A floating base is requested for something other than a URDF.
        UnknownNameError: The name is neither built in nor an existing file, and does not look like a path.
    """
    if floating and not is_model(name):
        remedy = "in a description, add a joint of kind F to the base"
        raise DescriptionError(f"only a URDF can be given a floating base, not {name}", where, remedy)
    if str(name) in mechanism_names():
        return FOLDER / str(name) / f"{name}.toml"
    path = named_file(folder, str(name))
    if is_model(path):
        from screwgauge.models.importing.model import imported_file

        return imported_file(path, allow, floating=floating)[0]
    if is_path(str(name)) or (where and is_file(path)):
        return _allow_tensors(path, [entry for entry in allow if entry.endswith(f".{TRIANGLE}")])
    raise UnknownNameError("mechanism", str(name), mechanism_names(), where, A_PATH)


def _allow_tensors(path: Path, allow: Sequence[str]) -> Path:
    """Extend the given description, in a temporary folder, so that it allows further tensors."""
    own = read_names(read_toml(path).get("allow", []), f"{path}, allow") if allow else ()
    if {*allow} <= {*own}:
        return path
    from screwgauge.models.importing.model import scratch_folder

    file = scratch_folder() / path.name
    texts = {"extends": str(path.resolve()), "allow": [*own, *allow]}
    file.write_text("".join(f"{key} = {json.dumps(value)}\n" for key, value in texts.items()), encoding="utf-8")
    return file


def load_mechanism(name: str | Path, *, closed: bool = True) -> Mechanism:
    """Read a mechanism by built-in name or path.

    Args:
        closed: Solve for the home pose if the loops are open at the home pose of the file.

    Raises:
        ClosureError: The loops do not close at any pose.
        ScrewgaugeError: The description does not exist or does not describe a mechanism.
    """
    path = mechanism_path(name)
    if FOLDER in path.parents:
        return _built_in(path)
    from screwgauge.models.home import at_closed_home

    return at_closed_home(_read(path)) if closed else _read(path)


def _read(path: Path) -> Mechanism:
    return read_mechanism(path, partial(mechanism_path, folder=path.parent, where=str(path)))


#: Built-in mechanisms do not change, and results are cached with the mechanism.
_built_in = cache(_read)


def description_files(path: Path) -> list[Path]:
    """List a description and the descriptions that it extends."""
    files = [path]
    while "extends" in (tables := read_toml(files[-1])):
        files.append(mechanism_path(tables["extends"], files[-1].parent, str(files[-1])))
    return files


def description_source(path: Path) -> Path:
    """Return the user's own description, even if a scene extends it, e.g. with contacts."""
    from screwgauge.models.importing.model import is_scratch

    return next(file for file in description_files(path) if not (is_scratch(file) and "extends" in read_toml(file)))


def mechanism_tables(name: str | Path) -> dict[str, Any]:
    """Return the tables of a description, merged with the tables that it extends; numbers remain unrounded strings.

    Raises:
        ScrewgaugeError: The description does not exist or cannot be read.
    """
    path = mechanism_path(name)
    return read_tables(path, partial(mechanism_path, folder=path.parent, where=str(path)))


def four_bars(n: int, *, driven: bool = False) -> str:
    """Write N four-bars in a row as TOML: pivots A_k = (k, 0, 0), N + 1 upright links, N horizontal links.

    The crank angle is measured about z from the upright position; the motion therefore starts at a rate of -1 rad/s.

    Args:
        n: Number of four-bars, at least one.
        driven: Let a motor turn the crank; the published problem has no motor.
    """
    lines = [
        f"# {n} four-bars in a row, benchmark problem A02 of the IFToMM library; written by models/catalog.py.",
        "# Links of 1 m and 1 kg; all of them are horizontal at the singular poses, crank = -pi/2 and pi/2.",
        "# Only the moments of inertia about z matter; those about the links' axes are small but not zero, which",
        "# MuJoCo refuses.",
        f'name = "a02-fourbar-{n}"',
        f'title = "{n}-four-bar mechanism (A02)"',
        'group = "benchmark problems"',
        'source = "IFToMM library of computational benchmark problems, A02"',
        "",
        "[independent]",
        'crank = "a0"',
    ]
    for k in range(n + 1):
        lines += _link(f"upright{k}", "[0, 0.5, 0]", ("1/12", "0.001", "1/12"))
    for k in range(n):
        lines += _link(f"bar{k}", "[0.5, 0, 0]", ("0.001", "1/12", "1/12"))
    for k in range(n + 1):
        lines += _joint(f"a{k}", "ground", f"upright{k}", f"[{k}, 0, 0]")
        lines += ["actuated = true"] if driven and k == 0 else []
    for k in range(n):
        lines += _joint(f"b{k}", f"upright{k}", f"bar{k}", "[0, 1, 0]")
        lines += [*_joint(f"c{k}", f"upright{k + 1}", f"bar{k}", "[0, 1, 0]"), _CHILD]
    return "\n".join(lines) + "\n"


_CHILD = "child_frame = { position = [1, 0, 0] }"


def _link(name: str, com: str, moments: tuple[str, str, str]) -> list[str]:
    xx, yy, zz = (f'"{moment}"' for moment in moments)
    inertia = f"inertia = {{ xx = {xx}, yy = {yy}, zz = {zz} }}"
    return ["", f"[bodies.{name}]", "mass = 1", f"com = {com}", inertia]


def _joint(name: str, parent: str, child: str, position: str) -> list[str]:
    bodies = [f'parent = "{parent}"', f'child = "{child}"']
    frame = f"parent_frame = {{ position = {position} }}"
    return ["", f"[joints.{name}]", 'kind = "R"', *bodies, "axes = [[0, 0, 1]]", frame]
