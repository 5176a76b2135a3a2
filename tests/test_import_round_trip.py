"""Description -> URDF with its loops file, MJCF -> import -> description: the same mechanism."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from screwgauge.reference.rigid import without_fixed_joints
from support.mechanism import Mechanism, load_mechanism, mechanism_names
from support.models import import_model, lay_out, write_models
from support.motions import forces

pytestmark = pytest.mark.slow

#: Rounding of the numbers of a model file, of MuJoCo's principal axes and of merging a body with its copies.
MASSES = 1e-13
#: The same, times the condition of the closed loops.
FORCES = 1e-11
#: One of each pair that differ in numbers only, and one of each size.
ALIKE = {"3ups-upu-s-asymmetric", "3ups-upu-s-offset", "3ups-upu-s-table2", "a02-fourbar-40", "a04-bricard-box"}
NAMES = [name for name in mechanism_names() if name not in ALIKE]
#: In the full cut, where welds join bodies and their copies: all kinds of joint.
FULL = {"3ups-upu-s", "geared-five-bar", "rccc", "stewart", "screw-press"}
#: An MJCF says an E joint by slides and a hinge, which stay apart, and nothing of friction where points close a joint.
IN_MJCF = [name for name in NAMES if name not in ("ruse", "geared-five-bar")]
FILES = [("{}.urdf", NAMES), ("{}.xml", IN_MJCF), ("{}-full.urdf", FULL), ("{}-full.xml", FULL)]
CASES = [(n, file.format(n)) for file, names in FILES for n in sorted(names)]


@cache
def written(name: str) -> tuple[Mechanism, TemporaryDirectory[str]]:
    mechanism, folder = load_mechanism(name), TemporaryDirectory()
    write_models(mechanism, Path(folder.name))
    return mechanism, folder


def imported(name: str, file: str) -> tuple[Mechanism, Mechanism]:
    mechanism, folder = written(name)
    found = import_model(Path(folder.name) / file).mechanism
    rigid = without_fixed_joints(mechanism)  # what is welded is one body in a file
    return replace(rigid, independent=found.independent), found


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize(("name", "file"), CASES)
def test_the_same_mechanism_comes_back(name, file, tmp_path):
    mechanism, found = imported(name, file)
    assert sorted(found.body_index) == sorted(mechanism.body_index)
    for body in mechanism.bodies:
        other = found.body(body.name)
        assert other.mass == pytest.approx(body.mass, rel=MASSES, abs=0)
        assert np.abs(other.com - body.com).max() <= MASSES * (1 + np.abs(body.com).max())
        assert np.abs(other.inertia - body.inertia).max() <= MASSES * (1 + np.abs(body.inertia).max())
    assert sorted(joint.kind for joint in found.joints) == sorted(joint.kind for joint in mechanism.joints)
    if mechanism.actuators:
        driven = sorted(joint.coordinates[0] for joint in mechanism.actuators)
        assert sorted(joint.coordinates[0] for joint in found.actuators) == driven
    home = mechanism.home[mechanism.independent_columns]
    one, other = forces(mechanism, home, tmp_path), forces(found, home, tmp_path)
    counted = {
        f"joint_position {name}" for name in lay_out(mechanism, "minimal").coordinates
    }  # cut ones anew, from home
    common = {key for key in one.keys() & other.keys() if not key.startswith("joint_position") or key in counted}
    assert {f"generalized_force {label}" for label in found.independent} <= common
    assert len(common) >= len(found.independent) * 2
    for quantity in ("joint_position", "generalized_force", "actuator_force"):
        names = [key for key in common if key.startswith(quantity)]
        size = max((np.abs(one[key]).max() for key in names), default=1.0)
        for key in names:
            assert np.abs(one[key] - other[key]).max() <= FORCES * size, key


def test_another_geometry_is_seen(tmp_path):
    """The comparison above can fail."""
    mechanism, folder = written("five-bar")
    text = (Path(folder.name) / "five-bar.xml").read_text(encoding="utf-8")
    assert 'pos="0.15 0 0"' in text
    (tmp_path / "five-bar.xml").write_text(text.replace('pos="0.15 0 0"', 'pos="0.1500001 0 0"'), encoding="utf-8")
    found = import_model(tmp_path / "five-bar.xml").mechanism
    mechanism = replace(mechanism, independent=found.independent)
    home = mechanism.home[mechanism.independent_columns]
    one, other = forces(mechanism, home, tmp_path), forces(found, home, tmp_path)
    assert any(np.abs(one[key] - other[key]).max() > 1e-8 for key in one.keys() & other.keys())
