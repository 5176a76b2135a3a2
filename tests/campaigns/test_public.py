"""Diagnoses of public models: one robot in two files, and a model that MuJoCo has saved again."""

from pathlib import Path

import mujoco
import pytest
from campaigns.public import PACKAGES, PAIRS, installed

from screwgauge import ScrewgaugeError, diagnose

#: How many models MuJoCo reads where they lie, saves so that it reads them again, and that have joints and masses.
SAVED = 18


@pytest.mark.campaign
@pytest.mark.parametrize("pair", PAIRS, ids=lambda pair: " ".join(pair["files"][1::2]))
def test_the_first_cause_of_a_pair(pair):
    one, file, two, other = pair["files"]
    causes = diagnose(installed(one, file), installed(two, other)).found.causes
    lead = [causes[0].facts[0].part, causes[0].facts[0].what] if causes else []
    assert lead == pair["lead"]


@pytest.mark.campaign
def test_a_model_that_is_saved_again_is_the_same_or_rounded(tmp_path):
    found = {}
    for package in ("robosuite", "dm-control"):
        for name in PACKAGES[package]["files"]:
            file, again = installed(package, name), tmp_path / f"{Path(name).parent.name}-{Path(name).name}"
            try:
                mujoco.mj_saveLastXML(str(again), mujoco.MjModel.from_xml_path(str(file)))
                found[name] = diagnose(file, again).found
            except (ValueError, ScrewgaugeError):  # of a name twice, without joints, or saved as it cannot be read
                continue
    assert len(found) >= SAVED
    told = {name: [cause.kind for cause in each.causes] for name, each in found.items() if each.causes}
    assert all(kinds == ["digits"] for kinds in told.values()), told
