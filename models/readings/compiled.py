"""Runs MuJoCo's compiler, formats its warnings and errors, and lists compiled content that readings lack."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from screwgauge.models.content import Content, Kind, Values, kinds, table
from screwgauge.models.mjcf import POWERS, without_stand_ins
from screwgauge.models.readings.reading import CouplingReading, Reading
from screwgauge.reference.couplings import PolynomialSum
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array

#: Text in MuJoCo's error about a file that a different library may accept -> remedy.
_REMEDIES = {
    "larger than mjMINVAL": "give that link a mass above 1e-15 kg and moments of inertia above 1e-15 kg m^2, e.g. 1e-6 "
    "times the values of a neighbouring link, or read the file with Pinocchio",
    "positive eigenvalues": "give that link positive principal moments of inertia, or read the file with Pinocchio",
    "A + B >= C": "give that link a physically possible inertia tensor, or read the file with Pinocchio",
    "top level": "read the file with Pinocchio; in MuJoCo, only direct children of the world can float",
}


def compile_text(
    text: str, where: str, models: Mapping[str, str] | None = None, meshes: Mapping[str, bytes] | None = None
) -> Any:
    """Compile a model without merging bodies that are fixed to each other and without opening files.

    Args:
        where: Name of the file, for error messages.
        models: File named in the text -> text of the model to attach.
        meshes: File named in the text -> content of that file.

    Raises:
        ModelFileError: MuJoCo rejects the model.
    """
    import mujoco

    attached = {name: model.encode() for name, model in (models or {}).items()}
    try:
        spec = mujoco.MjSpec.from_string(text, include=attached or None, assets=dict(meshes or {}) or None)
        spec.compiler.fusestatic = False  # bodies keep their names; MuJoCo 4.0.0 merges bodies of a URDF regardless
        _name_joints(spec)
        return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        message = " ".join(str(error).removeprefix("Error: ").split())
        remedy = next((remedy for sign, remedy in _REMEDIES.items() if sign in message), "correct the file")
        raise ModelFileError(f"MuJoCo refuses it ({message})", where, remedy) from None


def _name_joints(spec: Any) -> None:
    """Give the joints that MuJoCo generates for a composite or flex the names that unnamed joints of a file get."""
    taken = {joint.name for joint in spec.joints}
    for joint in [joint for joint in spec.joints if not joint.name]:
        name = f"{joint.parent.name}_joint"
        k = 1
        while (wanted := f"{name}_{k}" if k > 1 else name) in taken:
            k += 1
        joint.name = wanted
        taken.add(wanted)


@contextmanager
def collect_warnings() -> Iterator[list[str]]:
    """Collect MuJoCo's warnings; its default handler would write MUJOCO_LOG.TXT into the working directory."""
    import mujoco

    messages: list[str] = []
    mujoco.set_mju_user_warning(messages.append)
    try:
        yield messages
    finally:
        mujoco.set_mju_user_warning(None)


@contextmanager
def collect_phrases() -> Iterator[list[str]]:
    """Collect the warnings of MuJoCo and its Python package as phrases; the list is complete after the `with` block."""
    phrases: list[str] = []
    with collect_warnings() as messages, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield phrases
    phrases += [f"warning of MuJoCo: {text}" for text in (*messages, *(warning.message for warning in caught))]


#: Flags that change torques, motion under motors or the stiffness of constraints, but are not part of a reading.
_OFF, _ON = ("ACTUATION", "CLAMPCTRL", "REFSAFE"), ("OVERRIDE", "INVDISCRETE")
_FREE, _BALL = 0, 1
#: Arrays that define the path of a tendon.
_PATHS = ("wrap_type", "wrap_objid", "wrap_prm", "tendon_adr", "tendon_num", "tendon_type")
#: Arrays that give a tendon further effects than summing coordinates.
_PULLS = (
    *("stiffness", "stiffnesspoly", "damping", "dampingpoly"),
    *("frictionloss", "armature", "limited", "actfrclimited"),
)


def content(model: Any, reading: Reading) -> Iterator[Content]:
    """Yield the content of a compiled model that its reading lacks; content of joints comes first."""
    for kind in kinds().values():
        if kind.of == "joint":
            yield from _of_joints(model, kind)
    yield from _tendons(model)
    yield from _actuators(model)
    yield from _pairs(model, reading)
    yield from _options(model)
    yield from _uneven_compensation(model, reading)
    yield from _mocap_bodies(model)
    if model.nflex:
        yield Content("flexible bodies", "flexible bodies", f" ({model.nflex})")
    if model.nplugin:
        of_bodies = int(np.count_nonzero(model.body_plugin >= 0))
        yield Content("plugins", "plugins", f" ({model.nplugin})")
        yield from [Content("plugins of bodies", "plugins", f" of {of_bodies} bodies")] * bool(of_bodies)


def _entries(model: Any, arrays: Iterable[str], i: int) -> dict[str, Array]:
    """Return the entries of a joint, tendon, actuator or pair in the available arrays; set inactive ranges to zero."""
    entries = {name: np.ravel(getattr(model, name)[i]).astype(float) for name in arrays if hasattr(model, name)}
    for name in entries:
        limited = getattr(model, f"{name.removesuffix('range')}limited", None) if name.endswith("range") else None
        if limited is not None and not limited[i]:
            entries[name] = np.zeros(len(entries[name]))
    return entries


def _numbers(model: Any, arrays: Iterable[str], i: int) -> Values:
    """Return the values of a joint, tendon, actuator or pair, each with a label."""
    out: list[tuple[str, float | str]] = []
    for name, values in _entries(model, arrays, i).items():
        label = name.partition("_")[2]
        ends = [f"[{k}]" for k in range(len(values))] if len(values) > 1 else [""]
        out += [(f"{label}{end}", value) for end, value in zip(ends, values.tolist(), strict=True)]
    return tuple(out)


def _acts(model: Any, arrays: Iterable[str], i: int) -> bool:
    """Return True if any entry of the arrays differs from its neutral value."""
    neutral = table()["neutral"]
    for name, values in _entries(model, arrays, i).items():
        idle = np.zeros(len(values))
        idle[: len(neutral.get(name, ()))] = neutral.get(name, ())
        if not np.array_equal(values, idle):
            return True
    return False


def _of_joints(model: Any, kind: Kind) -> Iterator[Content]:
    of_dofs = kind.arrays[0].startswith("dof_")
    for j in range(model.njnt):
        i = model.jnt_dofadr[j] if of_dofs else j
        counts = not kind.joints or model.jnt_type[j] in kind.joints
        name = model.joint(j).name
        if counts and (not kind.when or getattr(model, kind.when)[i]) and _acts(model, kind.arrays, i):
            values = _numbers(model, kind.arrays, i)
            yield Content(kind.name, kind.name, f" of joint {name}", (("joints", name, 1.0),), values)


def _wraps(model: Any, tendon: int) -> range:
    return range(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])


def shares(model: Any, tendon: int) -> dict[int, float] | None:
    """Return joint -> coefficient of a fixed tendon; empty if there is no tendon, None for other kinds of tendon."""
    import mujoco

    at = _wraps(model, tendon) if tendon >= 0 else ()
    if any(model.wrap_type[k] != int(mujoco.mjtWrap.mjWRAP_JOINT) for k in at):
        return None
    return {int(model.wrap_objid[k]): float(model.wrap_prm[k]) for k in at}


def sites_along(model: Any, tendon: int) -> list[int] | None:
    """Return the sites along which a tendon runs; None if it also runs over geoms or pulleys."""
    import mujoco

    at = _wraps(model, tendon)
    over_sites = all(model.wrap_type[k] == int(mujoco.mjtWrap.mjWRAP_SITE) for k in at)
    return [int(model.wrap_objid[k]) for k in at] if over_sites else None


def _tendon_joints(model: Any, tendon: int) -> tuple[tuple[str, str, float], ...]:
    """Return the joints of a fixed tendon and their coefficients."""
    found = (shares(model, tendon) or {}).items()
    return tuple(sorted(("joints", model.joint(joint).name, share) for joint, share in found))


def _tendons(model: Any) -> Iterator[Content]:
    """Yield the tendons that exert forces; a tendon of an actuator or equality is reported together with its owner."""
    kind = kinds()["fixed tendons"]
    own = [name for name in kind.arrays if name not in _PATHS]
    for i in range(model.ntendon):
        if not any(np.any(getattr(model, f"tendon_{what}", np.zeros(model.ntendon))[i]) for what in _PULLS):
            continue
        name = f" {model.tendon(i).name}"
        if shares(model, i) is None:
            yield Content("spatial tendons", "spatial tendon", name)
            continue
        yield Content(kind.name, "fixed tendon", name, _tendon_joints(model, i), _numbers(model, own, i))


def single_joint(model: Any, actuator: int) -> int | None:
    """Return the hinge or slide that an actuator drives; None if it does not drive a hinge or slide."""
    joint = int(model.actuator_trnid[actuator, 0])
    return joint if _drives(model, actuator) == "joint" and model.jnt_type[joint] not in (_FREE, _BALL) else None


def coupled_joints(model: Any, actuator: int) -> dict[int, float]:
    """Return joint -> coefficient in an actuator's length before the gear; empty for other transmissions."""
    joint = single_joint(model, actuator)
    if joint is not None:
        return {joint: 1.0}
    return (shares(model, int(model.actuator_trnid[actuator, 0])) or {}) if _drives(model, actuator) == "tendon" else {}


def _drives(model: Any, actuator: int) -> str:
    """Return ``joint``, ``tendon`` (a fixed tendon), or an empty string for other transmissions."""
    import mujoco

    transmission, target = mujoco.mjtTrn(int(model.actuator_trntype[actuator])), int(model.actuator_trnid[actuator, 0])
    if transmission in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
        return "joint"
    if transmission == mujoco.mjtTrn.mjTRN_TENDON and shares(model, target) is not None:
        return "tendon"
    return ""


#: Arrays of an actuator, except its force law, that an import adds to the driven joint; and their description.
OF_JOINTS = ("actuator_armature", "actuator_damping", "actuator_dampingpoly")
RESISTS = "rotor and damping of actuator"


def _actuators(model: Any) -> Iterator[Content]:
    law, several = kinds()["force laws of actuators"], kinds()["actuators of several degrees of freedom"]
    for i in range(model.nu):
        name, drives, target = model.actuator(i).name, _drives(model, i), int(model.actuator_trnid[i, 0])
        if single_joint(model, i) is not None:
            if _acts(model, law.arrays, i):
                of = (("actuators", name, 1.0),)
                values = _numbers(model, law.arrays, i)
                own = _acts(model, [array for array in law.arrays if array not in OF_JOINTS], i)
                yield Content(law.name, "force law of actuator" if own else RESISTS, f" {name}", of, values)
        elif drives:
            alone = (("joints", model.joint(target).name, 1.0),) if drives == "joint" else ()
            along = alone or _tendon_joints(model, target)
            values = _numbers(model, ("actuator_trntype", *several.arrays, *law.arrays), i)
            yield Content(
                several.name, f"actuator {name}, which does not drive a single hinge or slide", "", along, values
            )
        else:
            yield Content("actuators with other transmissions", f"actuator {name}, which drives no joint")


def _pairs(model: Any, reading: Reading) -> Iterator[Content]:
    kind = kinds()["contact pairs"]
    arrays = kind.arrays[2:]  # without the geom indices
    for i in range(model.npair):
        bodies = [model.geom_bodyid[geom] for geom in (model.pair_geom1[i], model.pair_geom2[i])]
        names = sorted(reading.end_on(model.body(b).name if b else "")[0] for b in bodies)
        of = tuple(("bodies", name, 1.0) for name in names)
        yield Content(kind.name, "contact pair", f" of {names[0]} and {names[1]}", of, _numbers(model, arrays, i))


def _options(model: Any) -> Iterator[Content]:
    import mujoco

    medium = model.opt.density or model.opt.viscosity
    if medium and model.opt.wind.any():
        yield Content("wind", "option wind", "", (), tuple(zip("xyz", model.opt.wind.tolist(), strict=True)))
    for flag in _OFF:
        if model.opt.disableflags & int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}")):
            yield Content("switched off", f"flag {flag.lower()}, disabled", values=())
    for flag in _ON:
        if model.opt.enableflags & int(getattr(mujoco.mjtEnableBit, f"mjENBL_{flag}")):
            yield Content("switched on", f"flag {flag.lower()}, enabled", values=())
    if groups := int(model.opt.disableactuator):
        yield Content("switched off", "disabled actuator groups", values=(("bits", float(groups)),))
    if medium and model.geom_fluid[:, :1].any():
        what = "fluid shape of geoms"
        bodies = {model.body(model.geom_bodyid[i]).name for i in range(model.ngeom) if model.geom_fluid[i, 0]}
        yield from (Content(what, what, f" of body {name}") for name in sorted(bodies))


def _uneven_compensation(model: Any, reading: Reading) -> Iterator[Content]:
    """Yield the bodies whose parts differ in the compensated fraction of their weight."""
    shares_of_weight: dict[str, set[float]] = {}
    masses, _ = without_stand_ins(model.body_mass, model.body_inertia)
    for i in range(1, model.nbody):
        if masses[i]:
            body = reading.end_on(model.body(i).name)[0]
            shares_of_weight.setdefault(body, set()).add(float(model.body_gravcomp[i]))
    for name, values in shares_of_weight.items():
        if len(values) > 1 and name != GROUND:
            phrase = f"gravcomp of body {name}, which differs between its parts"
            yield Content("parts compensated differently", phrase)


def _mocap_bodies(model: Any) -> Iterator[Content]:
    """Yield the mocap bodies to which equalities attach."""
    import mujoco

    for i in range(model.nbody if model.neq else 0):
        if model.body_mocapid[i] < 0:
            continue
        ends = np.stack([model.eq_obj1id, model.eq_obj2id], axis=1)
        sites = model.eq_objtype == int(mujoco.mjtObj.mjOBJ_SITE)
        bodies = np.isin(model.eq_type, (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD)))
        at = [model.site_bodyid[e] if site else e for e, site in zip(ends[bodies], sites[bodies], strict=True)]
        if any(i in np.ravel(each) for each in at):
            yield Content("externally moved bodies", "mocap", f" of body {model.body(i).name}")


def coupling_of(model: Any, one: int, polynomials: Mapping[int, Array]) -> CouplingReading:
    """Convert ``y - y0 = sum P(x - x0)`` to powers of each x, where y is joint `one`; -1 stands for a constant."""
    zeros = {joint: float(model.qpos0[model.jnt_qposadr[joint]]) for joint in {one, *polynomials} if joint >= 0}
    names = {joint: model.joint(joint).name for joint in zeros}
    function = PolynomialSum.of({names.get(joint, ""): p for joint, p in polynomials.items()})
    shifts = {names[joint]: -zero for joint, zero in zeros.items() if zero and joint != one}
    return CouplingReading(names[one], function.change_variables(shifts, {}).plus(zeros[one]))


def tendon_equality(model: Any, i: int) -> CouplingReading | None:
    """Convert ``L1 - L10 = P(L2 - L20)`` of fixed tendons to a coupling if P is linear or L2 depends on one joint."""
    first, second = (shares(model, tendon) for tendon in (model.eq_obj1id[i], model.eq_obj2id[i]))
    p = model.eq_data[i, : POWERS if model.eq_obj2id[i] >= 0 else 1]
    if first is None or second is None:
        return None
    if not p[2:].any():
        slope = float(p[1]) if len(p) > 1 else 0.0
        both = {joint: first.get(joint, 0.0) - slope * second.get(joint, 0.0) for joint in {**first, **second}}
        moved = [joint for joint, share in both.items() if share]
        if not moved:
            return None
        y = moved[-1] if len(moved) == 2 else moved[0]
        slopes = {x: np.array([0.0, -both[x] / both[y]]) for x in moved if x != y}
        return coupling_of(model, y, {**slopes, -1: np.array([p[0] / both[y]])})
    if len(second) != 1 or {*first} <= {*second}:
        return None
    ((x, per),) = second.items()
    y = next(joint for joint in first if joint != x)
    slopes = {joint: np.array([0.0, -share / first[y]]) for joint, share in first.items() if joint != y}
    curve = p * per ** np.arange(len(p)) / first[y]
    curve[1] += slopes.pop(x, np.zeros(2))[1]
    return coupling_of(model, y, {x: curve, **slopes})
