"""What readings and imports of model files hold, a row each of `claims/readings.toml`."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from support.claims import cases, table, written
from support.models import BorneWeight, Imported, Options, import_model
from support.readings import Reading, libraries_for, read, with_loops
from support.scene import check_home

TABLE = table("readings")
BODY = ("near", "joints", "mass", "com", "inertia", "gravcomp", "first", "copy_of")
JOINT = ("kind", "direction", "centre", "home", "limits", "armature", "damping", "friction", "stiffness", "rest")
KEYS = {"by", "files", "edits", "old", "new", "text", "facts", "near", "ignored", "says", "silent"}


def facts_of(reading: Reading) -> dict[str, Any]:
    facts: dict[str, Any] = {
        what: [*getattr(reading, what)] for what in ("bodies", "joints", "fixed", "closures", "couplings", "actuators")
    }
    facts |= {
        "gravity": [] if reading.gravity is None else reading.gravity,
        "medium": reading.medium,
        "remarks": len(reading.remarks),
    }
    facts["copies"] = [name for body in reading.bodies.values() if body.copy_of for name in body.joints]
    facts["forces"] = [dict(c.values)["actfrcrange[1]"] for c in reading.content if c.kind == "force limits"]
    facts |= {f"drive {key}": x for c in reading.content if c.kind == "drives" for key, x in c.values}
    facts |= {"content": len(reading.content), "ignored": len(reading.ignored)}
    for name, body in reading.bodies.items():
        facts |= {f"{name}.{key}": getattr(body, key) for key in BODY}
        facts |= {f"{name}.at": body.pose[:3, 3], f"{name}.turn": body.pose[:3, :3], f"{name}.parts": [*body.fixed]}
        facts[f"{name}.moments"] = np.diag(body.inertia)
    for name, joint in reading.joints.items():
        facts |= {f"{name}.{key}": getattr(joint, key) for key in JOINT}
    for name, closure in reading.closures.items():
        facts[f"{name}.closes"] = [closure.kind, closure.first, closure.second]
        frames = np.array([closure.first_frame, closure.second_frame])
        facts |= {f"{name}.at": frames[:, :3, 3], f"{name}.turns": frames[:, :3, :3]}
    for name, coupling in reading.couplings.items():
        facts |= {f"{name}.by {lead}": law for lead, law in coupling.function.polynomials.items()}
        facts[f"{name}.couples"] = coupling.named
    for name, (joint, gear) in reading.actuators.items():
        facts |= {f"{name}.drives": joint, f"{name}.gear": gear}
    return facts | {"kinds": sorted(joint.kind for joint in reading.joints.values())}


def facts_of_import(imported: Imported) -> dict[str, Any]:
    mechanism = imported.mechanism
    facts: dict[str, Any] = {f"{body.name}.mass": body.mass for body in mechanism.bodies}
    facts |= {f"{one.name}.couples": [one.coordinate, *one.function.terms] for one in mechanism.couplings}
    facts |= {f"{one.name}.slopes": [*one.function.slopes.values()] for one in mechanism.couplings}
    for joint in mechanism.joints:
        facts |= {f"{joint.name}.limits": joint.limits, f"{joint.name}.home": joint.home}
    facts |= {one.name: one.amount for one in mechanism.resistances}
    facts |= {f"{one.coordinate}.spring": [one.stiffness, one.rest] for one in imported.springs}
    facts |= {f"{one.body}.borne": one.mass for one in mechanism.left_out if isinstance(one, BorneWeight)}
    kinds = "".join(sorted(joint.kind for joint in mechanism.joints))
    return facts | {
        "bodies": [body.name for body in mechanism.bodies],
        "joints": [joint.name for joint in mechanism.joints],
        "kinds": kinds,
        "coordinates": mechanism.coordinates,
        "couplings": [one.name for one in mechanism.couplings],
        "springs": [one.coordinate for one in imported.springs],
        "independent": dict(mechanism.independent),
        "actuators": [joint.name for joint in mechanism.actuators],
        "names": dict(imported.names),
        "left out": sorted(phrase.split(" of ")[0] for phrase in imported.left_out),
    }


def is_near(value: Any, claimed: Any, near: float) -> bool:
    if isinstance(claimed, dict | str | bool) or claimed == [] or value is None:
        return bool(value == claimed)
    if isinstance(np.ravel(claimed).tolist()[0], str):
        return [*map(str, value)] == [*map(str, claimed)]
    return np.shape(value) == np.shape(claimed) and value == pytest.approx(np.array(claimed), rel=near, abs=near * 1e-6)


def lacking(said: Iterable[str], words: list[list[str]]) -> list[list[str]]:
    sentences = [*said]
    return [group for group in words if not any(all(word in each for word in group) for each in sentences)]


@pytest.mark.parametrize("row", [*cases(TABLE["reading"], KEYS)])
def test_facts(row, tmp_path):
    if any(name.endswith(".usda") for name in row["files"]):
        pytest.importorskip("pxr", reason="usd-core (extra: usd)")
    path = written(row, TABLE["texts"], tmp_path)
    check(row, path)


def check(row: dict[str, Any], path: Path) -> None:
    how, _, library = row["by"].partition(" ")
    if how == "import":
        imported = import_model(path, Options(library=library))
        check_home(imported.mechanism)
        facts, said, ignored = facts_of_import(imported), imported.remarks, imported.left_out
    else:
        file = path.with_name("robot.urdf") if how == "loops" else path
        reading = read(file, library or libraries_for(file)[0])
        reading = with_loops(reading, path) if how == "loops" else reading
        facts, said, ignored = facts_of(reading), reading.remarks, reading.ignored
    claimed = row.get("facts", {})
    wrong = {k: facts.get(k) for k, v in claimed.items() if not is_near(facts.get(k), v, row.get("near", 1e-6))}
    assert wrong == {}, claimed
    assert lacking(said, row.get("says", [])) == []
    assert [phrase for phrase in row.get("ignored", []) if phrase not in ignored] == []
    assert [word for word in row.get("silent", []) if any(word in each for each in (*said, *ignored))] == []
