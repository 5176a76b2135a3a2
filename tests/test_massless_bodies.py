import re

import numpy as np
import pytest

import screwgauge
from screwgauge import load_scene
from support.claims import table
from support.errors import DescriptionError, SingularPoseError
from support.judging import agreed
from support.mechanism import load_mechanism
from support.models import check_models, write_models
from support.planar import Bar, four_bar
from support.tolerances import LINEAR, STEPPED

TREES = ["pinocchio", "mujoco", "pinocchio-full", "mujoco-full"]
TABLE = table("massless")
CROSS, UNIVERSAL, FOUR_BAR, PLATFORM, GEARED = TABLE["models"].values()
CROSSED, CRANKED, POSED, FALLING = TABLE["motions"].values()
BOB = "mass = 1.3\ncom = [0.02, 0.01, -0.3]\ninertia = { xx = 2e-2, yy = 1.5e-2, zz = 1e-2, xy = 1e-3 }\n"


@pytest.fixture
def scene(write):
    def make(text, lines):
        end = 0.1 if "[forward]" in lines else 0.5
        write("m.toml", text)
        return load_scene(
            write("s.toml", f'mechanism = "m.toml"\ntime = {{ duration = {end}, step = 0.1 }}\n{lines}\n')
        )

    return make


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "lines"), [(CROSS, CROSSED), (FOUR_BAR, CRANKED), (PLATFORM, POSED)], ids=["cross", "coupler", "carriers"]
)
def test_all_engines_agree_on_given_motions(text, lines, scene):
    results = screwgauge.run(scene(text, lines), engines=["truth", "screw", *TREES])
    assert not results.failures
    assert results.pairs["ok"].all(), results.pairs[~results.pairs["ok"]].to_string()
    assert {"cross.x", "coupler.x", "carrier.x"} & set(results.components("com_acceleration"))


def test_a_massless_cross_is_a_universal_joint(scene):
    crossed = screwgauge.run(scene(CROSS, CROSSED), engines=["screw"])
    universal = screwgauge.run(scene(UNIVERSAL, CROSSED), engines=["screw"], quantities=["generalized_force"])
    force = universal.values("generalized_force")
    assert crossed.values("actuator_force") == pytest.approx(force, abs=LINEAR * np.abs(force).max())


def test_a_massless_cross_falls_as_a_universal_joint_does(scene):
    results = agreed(screwgauge.run(scene(CROSS, FALLING), engines=["screw", "pinocchio", "mujoco"]))
    same = screwgauge.run(scene(UNIVERSAL, FALLING), engines=["screw"])
    assert results.values("joint_position", "screw") == pytest.approx(same.values("joint_position"), abs=STEPPED)


@pytest.mark.slow
def test_a_platform_on_massless_carriers_falls_alike_in_all_engines(scene):
    start = "[forward]\nstart = { z = 1 }\nrates = { x = 0.5, z = -0.2, turn = 0.3 }"
    agreed(screwgauge.run(scene(PLATFORM, start), engines=["screw", "pinocchio", "mujoco"]))


def test_a_tree_that_ends_without_mass_is_simulated_by_screw_alone(scene):
    start = "[forward]\nstart = { crank = 0.1 }\nrates = { crank = 1 }"
    results = screwgauge.run(scene(FOUR_BAR, start), engines=["screw", "pinocchio", "mujoco"])
    assert set(results.failures) == {"pinocchio", "mujoco"}
    for engine, failure in results.failures.items():
        assert re.search(f"'coupler' .* no mass.* {engine}", failure.reason)
    assert np.isfinite(results.values("joint_acceleration", "screw")).all()


def test_a_coordinate_that_moves_no_mass_is_refused_in_simulations(scene):
    text = (
        CROSS
        + """
[bodies.vane]
mass = 0
[joints.c]
kind = "R"
parent = "bob"
child = "vane"
axes = [[0, 0, 1]]
"""
    )
    text = text.replace('b = "b" }', 'b = "b", c = "c" }')
    with pytest.raises(SingularPoseError, match="the coordinate 'c' moves no mass"):
        screwgauge.run(scene(text, FALLING.replace("b = 0.4", "b = 0.4, c = 0")), engines=["screw"])


@pytest.mark.slow
@pytest.mark.parametrize("text", [CROSS, FOUR_BAR, PLATFORM], ids=["cross", "coupler", "carriers"])
def test_model_files_say_what_the_description_says(text, write, tmp_path):
    mechanism = load_mechanism(write("m.toml", text))
    write_models(mechanism, tmp_path / "models")
    wrong = [row for row in check_models(mechanism, tmp_path / "models") if not row.ok]
    assert not wrong


def test_a_body_lighter_than_mujoco_takes_is_told_so(scene):
    text = CROSS.replace("mass = 0\n", "mass = 1e-14\ninertia = { xx = 1e-17, yy = 1e-17, zz = 1e-17 }\n")
    results = screwgauge.run(scene(text, CROSSED), engines=["screw", "mujoco"])
    reason = results.failures["mujoco"].reason
    assert "more than 1e-15 kg" in reason


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "mass = 0",
            "mass = 0\ncom = [0, 0, 1]",
            "bodies.cross: a massless body",
        ),
        (
            "mass = 0",
            "mass = 0\ninertia = { xx = 1, yy = 1 }",
            "bodies.cross: a massless body",
        ),
        (
            "mass = 0",
            "mass = -1\ninertia = {}",
            "bodies.cross: mass -1 kg",
        ),
        (BOB, "mass = 0\n", "bodies: no body has mass"),
    ],
)
def test_what_a_massless_body_cannot_have_is_refused(old, new, said, write):
    with pytest.raises(DescriptionError, match=re.escape(said)):
        load_mechanism(write("m.toml", CROSS.replace(old, new)))


def point_mass_coupler() -> str:
    text = 'name = "four-bar"\nindependent.arm = "a"\n' + four_bar([Bar(0.3), Bar(0.6), Bar(0.4)], 0.5, 1.0)
    whole = Bar(0.6).written("coupler")
    assert whole in text
    return text.replace(whole, "[bodies.coupler]\nmass = 1.2\ninertia = { xx = 0, yy = 0, zz = 0 }\n")


@pytest.mark.parametrize(("text", "body"), [(GEARED, "wheel"), (point_mass_coupler(), "coupler")])
def test_a_point_mass_at_its_own_hinge_is_named_where_pinocchio_cannot_accelerate_it(text, body, scene):
    results = screwgauge.run(scene(text, "[forward]\nrates = { arm = 0.5 }"), engines=["screw", "pinocchio", "mujoco"])
    assert {*results.failures} == {"pinocchio"}
    reason = results.failures["pinocchio"].reason
    assert f"'{body}'" in reason
    assert "moment of inertia" in reason
    assert results.errors["ok"].all()
