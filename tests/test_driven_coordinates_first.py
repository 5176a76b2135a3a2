from pathlib import Path

import numpy as np
import pytest

import screwgauge
from support.data import DATA, data
from support.models import Imported, Options, description, import_model

G = 9.81

#: A boom of 4 m, raised by a ram whose line passes the pivot at 50 mm: a radian of the boom is 50 mm of stroke.
BOOM = data("boom.xml")

#: A slider-crank in line, whose slide is at its dead centre.
IN_LINE = data("in-line.xml")


def held(path: Path, folder: Path, **home: float) -> dict[str, float]:
    (folder / "machine.toml").write_text(description(import_model(path).mechanism), encoding="utf-8")
    motion = "\n".join(f"motion.{name}.offset = {value}" for name, value in home.items())
    scene = folder / "hold.toml"
    scene.write_text(f'mechanism = "machine.toml"\ntime.times = [0]\n{motion}\n', encoding="utf-8")
    results = screwgauge.run(screwgauge.load_scene(scene), quantities=["actuator_force"])
    assert results.ok
    forces = results.values("actuator_force", engine="screw")[0]
    return dict(zip(results.components("actuator_force"), forces.tolist(), strict=True))


def said(imported: Imported) -> str:
    return " ".join(each for each in imported.remarks if "not independent" in each)


def test_a_bucket_is_moved_by_its_three_motors(tmp_path):
    path = DATA / "bucket-linkage.xml"
    imported = import_model(path)
    assert [*imported.mechanism.independent] == ["boom", "ram2", "ram3"]
    assert not said(imported)
    forces = held(path, tmp_path, boom=0.0, ram2=0.434, ram3=0.594)
    expected = {"boom": -82215.374, "ram2": -29573.030, "ram3": -6588.948}  # computed apart from this package
    assert forces == pytest.approx(expected, rel=1e-7, abs=0)


def test_a_short_stroke_comes_before_a_hinge_that_nothing_drives(write, tmp_path):
    path = write("boom.xml", BOOM)
    assert [*import_model(path).mechanism.independent] == ["tip", "ram"]
    force = G * (300 * 2 + 10 * 4 + 8 * 0.6) / 0.05
    assert held(path, tmp_path, tip=0.0, ram=0.0) == pytest.approx({"tip": 0.0, "ram": force}, rel=1e-12, abs=1e-9)


def test_a_motor_at_its_dead_centre_is_passed_over_and_named(write):
    imported = import_model(write("in-line.xml", IN_LINE.format("")))
    assert "slide" not in imported.mechanism.independent
    assert "'slide'" in said(imported)
    assert "dead centre" in said(imported)


def test_a_motor_beyond_the_freedoms_is_named_with_those_that_it_follows(write):
    imported = import_model(write("two.xml", BOOM.replace('<motor joint="tip"/>', '<motor joint="pivot"/>')))
    independent = {*imported.mechanism.independent}
    assert len(independent) == 2
    (other,) = {"pivot", "ram"} - independent
    (leader,) = {"pivot", "ram"} & independent
    assert f"'{other}' (determined by '{leader}')" in said(imported)


def test_who_chooses_hears_nothing_of_it(write):
    wanted = Options(independent={"tip": "tip", "pivot": "pivot"})
    imported = import_model(write("boom.xml", BOOM), wanted)
    assert [*imported.mechanism.independent] == ["tip", "pivot"]
    assert not said(imported)
    assert np.isfinite(imported.mechanism.home).all()
