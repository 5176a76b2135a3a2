import numpy as np
import pytest

import screwgauge
from support.graphs import described, reading_of, sdf_of, wanted
from support.mechanism import load_mechanism
from support.models import Imported, description, import_model, write_models
from support.motions import forces, worst

#: Rounding, times the condition of closed loops.
FORCES = 1e-11
#: Mechanism and the kind of the joints that close its loops.
CASES = [
    ("bennett", "R"),
    ("slider-crank", "P"),
    ("3-upu", "P"),
    ("3-upu", "U"),
    ("double-cardan", "U"),
    ("3-rps", "S"),
    ("rccc", "C"),
    ("ruse", "E"),
    ("screw-press", "C"),
]
#: Kinds that an SDF has.
IN_SDF = [case for case in CASES if case[1] not in "CE"]


def deviation(name: str, imported: Imported, folder) -> float:
    mechanism, found = load_mechanism(name), imported.mechanism
    return worst(*(forces(each, each.home[each.independent_columns], folder) for each in (mechanism, found)))


@pytest.mark.parametrize(("name", "last"), CASES)
def test_joints_of_every_kind_close_loops(name, last, tmp_path):
    reading = reading_of(load_mechanism(name), last)
    copies = {body.joints: body.copy_of for body in reading.bodies.values() if body.copy_of}
    assert copies, "no joint closes a loop"
    assert deviation(name, described(load_mechanism(name), last), tmp_path) < FORCES


@pytest.mark.parametrize("name", ["slider-crank", "bennett"])
def test_joints_that_close_loops_keep_names_coordinates_and_limits(name):
    mechanism = load_mechanism(name)
    found = described(mechanism, mechanism.joints[-1].kind).mechanism
    for joint in mechanism.joints:
        other = found.joint(joint.name)
        assert other.kind == joint.kind
        assert other.home == pytest.approx(joint.home, abs=1e-15)
        assert np.array_equal(other.limits, joint.limits)


@pytest.mark.parametrize(("name", "last"), IN_SDF)
def test_an_sdf_is_the_mechanism_that_it_was_made_of(name, last, tmp_path):
    mechanism, file = load_mechanism(name), tmp_path / f"{name}.sdf"
    file.write_text(sdf_of(mechanism, last), encoding="utf-8")
    assert deviation(name, import_model(file, wanted(mechanism)), tmp_path) < FORCES


@pytest.mark.parametrize(("name", "last"), [("slider-crank", "P"), ("3-upu", "U"), ("3-rps", "S")])
def test_where_a_file_closes_its_loops_is_no_difference(name, last, tmp_path):
    mechanism, file = load_mechanism(name), tmp_path / "a.sdf"
    file.write_text(sdf_of(mechanism, last), encoding="utf-8")
    found = import_model(file, wanted(mechanism)).mechanism
    write_models(found, tmp_path)
    (tmp_path / "found.toml").write_text(description(found), encoding="utf-8")
    for other in (f"{found.name}.xml", "found.toml"):
        diagnosis = screwgauge.diagnose(file, tmp_path / other)
        assert not [fact for fact in diagnosis.differences if fact.kind == "model"]
        assert diagnosis.same or last == "S"  # which a description says by three hinges, another convention
