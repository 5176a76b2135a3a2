"""Random mechanisms of which nothing drives some freedoms: every pair of engines agrees, or the refusal is true."""

import tomllib
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from campaigns.verdict import judged

import screwgauge
from screwgauge import ScrewgaugeError
from screwgauge.families.draw import families
from screwgauge.models.catalog import load_mechanism
from screwgauge.reference.expressions import vector
from screwgauge.scene.idle import undriven_labels
from screwgauge.study.run import run

ENGINES = ("screw", "pinocchio", "mujoco", "lagrange")
COUNT = 200
#: Share of the drawn motion that is followed: what falls freely soon leaves what loops reach.
SHARE = 0.3
#: True reasons for a refusal: the motion runs away or meets a singular pose, limits, or forces that decide nothing.
REFUSED = ("breaks off", "limits", "singular", "cannot close", "no force decides", "cannot rest", "drive")


def without_actuators(description: dict[str, Any], rng: np.random.Generator, freedoms: int) -> bool:
    driven = [name for name, joint in description["joints"].items() if joint.get("actuated")]
    if freedoms < 2:
        return False
    rng.shuffle(driven)
    for name in driven[int(rng.integers(1, freedoms)) :]:
        del description["joints"][name]["actuated"]
    return True


def with_spin(description: dict[str, Any], rng: np.random.Generator) -> bool:
    universal = [name for name, joint in description["joints"].items() if joint["kind"] == "U"]
    if not universal:
        return False
    name = universal[int(rng.integers(len(universal)))]
    joint = description["joints"][name]
    first, second = (vector(axis, "") for axis in joint["axes"])
    joint |= {"kind": "S", "axes": [*joint["axes"], np.cross(first, second).tolist()]}
    joint |= {"home": [*joint["home"], 0.0]} if "home" in joint else {}
    joint["coordinates"] = [*joint.get("coordinates", [f"{name}.q1", f"{name}.q2"]), f"{name}.spin"]
    for key in ("limits", "rotor", "damping", "friction"):
        joint.pop(key, None)
    description["independent"]["spin"] = f"{name}.spin"
    return True


def drawn(seed: int, folder: Path) -> Path | None:
    rng, names = np.random.default_rng(seed), families()
    scene = screwgauge.random(seed, names[seed % len(names)], folder)
    files = {file: tomllib.loads(file.read_text(encoding="utf-8")) for file in folder.glob("*.toml")}
    description = next(file for file, data in files.items() if "bodies" in data)
    other = next(file for file in files if file != description)
    data, said = files[description], files[other]
    freed = without_actuators(data, rng, len(scene.mechanism.independent)) if seed % 2 else with_spin(data, rng)
    if not freed:
        return None
    description.write_text(tomli_w.dumps(data), encoding="utf-8")
    labels = [*scene.mechanism.independent]
    start = dict(zip(labels, scene.motion.y[0].tolist(), strict=True))
    idle = undriven_labels(load_mechanism(description))
    for label in idle:
        said["motion"].pop(label, None)
    said["idle"] = {label: {"start": start[label]} for label in idle if label in start}
    said["time"] = {"times": (SHARE * scene.t).tolist()}
    said.pop("rule", None)
    other.write_text(tomli_w.dumps(said), encoding="utf-8")
    return other


@pytest.mark.campaign
def test_engines_agree_on_what_nothing_drives(tmp_path, request):
    count, counts, seed, wrong = request.config.getoption("--count") or COUNT, Counter[str](), 0, list[str]()
    while counts["agree"] + counts["refused"] < count:
        seed += 1
        folder = tmp_path / str(seed)
        folder.mkdir()
        try:
            if (file := drawn(seed, folder)) is None:
                counts["nothing freed"] += 1
                continue
            found = judged(run(screwgauge.load_scene(file), ENGINES))
        except ScrewgaugeError as error:
            counts["refused"] += 1
            if not any(reason in str(error) for reason in REFUSED):
                wrong.append(f"seed {seed}: {error}")
            continue
        counts["agree"] += 1
        if found["verdict"] not in ("agree", "estimated"):
            wrong.append(f"seed {seed}: {found}")
    print(dict(counts))
    assert not wrong, "\n".join(wrong)
    assert counts["agree"] > count // 2
