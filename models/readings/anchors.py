"""Checks that the second points of connect constraints, which MuJoCo derives from the file's pose, are near bodies."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from screwgauge.models.files.parts import name_all, parts
from screwgauge.models.files.xml import parse
from screwgauge.models.readings.compiled import collect_phrases
from screwgauge.models.readings.meshes import classes_of, shapes
from screwgauge.models.readings.mujoco import load_mujoco
from screwgauge.models.readings.source import Source
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.rotations import Array

#: Casebook entry on the second points of connect constraints.
CASE = "connect-anchor-at-qpos0"
#: Distance from all geoms and sites beyond which a point counts as far from a body, as a fraction of the body's extent.
OFF = 0.1


def points_off_bodies(source: Source) -> Iterator[str]:
    """Yield a message for each anchored connect whose second point is far from all geoms and sites of its body.

    MuJoCo places that point at the anchor in the pose of the file. Bodies with meshes are skipped because meshes are
    not read.
    """
    roots = (source.root, *source.attached.values())
    if source.form != "mjcf" or not any(root.find("equality/connect") is not None for root in roots):
        return
    import mujoco

    try:
        with collect_phrases():
            model = load_mujoco(source)
    except ModelFileError:  # a different library reads the file
        return
    data, meshed = mujoco.MjData(model), _mesh_bodies(source)
    mujoco.mj_kinematics(model, data)
    for i in range(model.neq):
        body = int(model.eq_obj2id[i])
        connect = model.eq_type[i] == mujoco.mjtEq.mjEQ_CONNECT and model.eq_active0[i]
        if connect and model.eq_objtype[i] == mujoco.mjtObj.mjOBJ_BODY and model.body_weldid[body]:
            distance, reach = _distance(model, data, body, model.eq_data[i, 3:6], meshed)
            if distance > OFF * reach:
                yield _sentence(model, i, distance)


def _mesh_bodies(source: Source) -> tuple[str, ...]:
    """Return the names of bodies with geoms read from files, without the prefix that attached bodies get."""
    files = parts(parse(source.path), source.path)
    taken, names = {element.get("name") for part in files for element in part.root.iter()}, list[str]()
    for part in files:
        name_all(part.root, taken)
        classes = classes_of(part.root)
        names += [shape.body.get("name", "") for shape in shapes(part.root) if shape.from_file(classes)]
    return tuple(filter(None, names))


def _distance(model: Any, data: Any, body: int, point: Array, meshed: tuple[str, ...]) -> tuple[float, float]:
    """Compute the distance of a point on a body from the nearest geom box or site, and the extent of these [m].

    Geoms and sites of bodies fixed to the body also count. The extent is infinite without geoms and sites, or with a
    mesh.
    """
    fixed = [k for k in range(model.nbody) if model.body_weldid[k] == model.body_weldid[body]]
    if any(model.body(k).name.endswith(meshed) for k in fixed):
        return 0.0, np.inf
    at = data.xpos[body] + data.xmat[body].reshape(3, 3) @ point
    near, far = list[float](), list[float]()
    for g in np.flatnonzero(np.isin(model.geom_bodyid, fixed)):
        local = data.geom_xmat[g].reshape(3, 3).T @ (at - data.geom_xpos[g]) - model.geom_aabb[g, :3]
        near.append(float(np.linalg.norm(np.maximum(np.abs(local) - model.geom_aabb[g, 3:], 0.0))))
        far.append(float(np.linalg.norm(data.geom_xpos[g] - data.xpos[body]) + model.geom_rbound[g]))
    for s in np.flatnonzero(np.isin(model.site_bodyid, fixed)):
        near.append(float(np.linalg.norm(at - data.site_xpos[s])))
        far.append(float(np.linalg.norm(data.site_xpos[s] - data.xpos[body])))
    return (min(near), max(far)) if near else (0.0, np.inf)


def _sentence(model: Any, i: int, distance: float) -> str:
    first, second = (model.body(k).name or "world" for k in (model.eq_obj1id[i], model.eq_obj2id[i]))
    point = ", ".join(f"{x + 0.0:.4g}" for x in np.round(model.eq_data[i, 3:6], 9))
    return (
        f"Check {model.equality(i).name}: MuJoCo places its second point at ({point}) m in {second}, which coincides "
        f"with the point of {first} in the pose of the file, but is {distance:.3g} m away from every geom and site of "
        f"{second}. If that pose leaves the loop open, close it with site1 and site2 (casebook: {CASE})."
    )
