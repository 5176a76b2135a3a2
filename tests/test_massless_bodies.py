from __future__ import annotations

import re

import numpy as np
import pytest

import screwgauge
from screwgauge import load_scene
from support.errors import DescriptionError, SingularPoseError
from support.judging import agreed
from support.mechanism import load_mechanism
from support.models import check_models, write_models
from support.planar import Bar, four_bar
from support.tolerances import LINEAR, STEPPED

TREES = ["pinocchio", "mujoco", "pinocchio-full", "mujoco-full"]
BOB = "mass = 1.3\ncom = [0.02, 0.01, -0.3]\ninertia = { xx = 2e-2, yy = 1.5e-2, zz = 1e-2, xy = 1e-3 }\n"

CROSS = """
name = "cross"
independent = { a = "a", b = "b" }
[bodies.cross]
mass = 0
[bodies.bob]
BOB
[joints.a]
kind = "R"
parent = "ground"
child = "cross"
axes = [[1, 0, 0]]
parent_frame.position = [0, 0, 0.4]
actuated = true
[joints.b]
kind = "R"
parent = "cross"
child = "bob"
axes = [[0, 1, 0]]
child_frame.position = [0, 0, 0.1]
actuated = true
""".replace("BOB\n", BOB)

#: The same as one joint, which no actuator drives.
UNIVERSAL = """
name = "universal"
independent = { a = "u.q1", b = "u.q2" }
[bodies.bob]
BOB
[joints.u]
kind = "U"
parent = "ground"
child = "bob"
axes = [[1, 0, 0], [0, 1, 0]]
parent_frame.position = [0, 0, 0.4]
child_frame.position = [0, 0, 0.1]
""".replace("BOB\n", BOB)

FOUR_BAR = """
name = "four-bar"
independent = { crank = "a" }
[bodies]
crank = { mass = 0.5, com = [0, 0, 0.1], inertia = { xx = 2e-3, yy = 2e-3, zz = 1e-4 } }
coupler = { mass = 0 }
rocker = { mass = 0.9, com = [0.05, 0, 0.2], inertia = { xx = 1.3e-2, yy = 1.3e-2, zz = 1e-3 } }
[joints]
a = { kind = "R", parent = "ground", child = "crank", axes = [[0, 1, 0]], actuated = true }
b = { kind = "R", parent = "crank", child = "coupler", axes = [[0, 1, 0]], parent_frame.position = [0, 0, 0.2] }
c = { kind = "R", parent = "ground", child = "rocker", axes = [[0, 1, 0]], parent_frame.position = [0.4, 0, 0] }
[joints.d]
kind = "R"
parent = "coupler"
child = "rocker"
axes = [[0, 1, 0]]
parent_frame.position = [0.5, 0, 0.2]
child_frame.position = [0.1, 0, 0.4]
"""


_LEG = """
[bodies."leg{k}.low"]
mass = 0.3
com = [0, 0, 0.2]
inertia = {{ xx = 1e-3, yy = 1e-3, zz = 1e-4 }}
[bodies."leg{k}.high"]
mass = 0.2
com = [0, 0, -0.2]
inertia = {{ xx = 1e-3, yy = 1e-3, zz = 1e-4 }}
[joints."leg{k}.foot"]
kind = "R"
parent = "ground"
child = "leg{k}.low"
axes = [[0, 1, 0]]
parent_frame.position = [{foot}, 0, 0]
home = ["atan({head} - ({foot}))"]
[joints."leg{k}.slide"]
kind = "P"
parent = "leg{k}.low"
child = "leg{k}.high"
axes = [[0, 0, 1]]
home = ["sqrt(1 + ({head} - ({foot}))**2)"]
actuated = true
[joints."leg{k}.head"]
kind = "R"
parent = "leg{k}.high"
child = "top"
axes = [[0, 1, 0]]
child_frame.position = [{head}, 0, 0]
home = ["-atan({head} - ({foot}))"]
"""
#: A platform on three legs in a plane, its pose being the coordinates of a chain of massless carriers.
PLATFORM = """
name = "platform"
independent = { x = "carried.x", z = "carried.z", turn = "carried.turn" }
[bodies]
slide = { mass = 0 }
carrier = { mass = 0, inertia = {} }
top = { mass = 2, com = [0.02, 0, 0.03], inertia = { xx = 2e-2, yy = 3e-2, zz = 2e-2 } }
[joints]
"carried.x" = { kind = "P", parent = "ground", child = "slide", axes = [[1, 0, 0]] }
"carried.z" = { kind = "P", parent = "slide", child = "carrier", axes = [[0, 0, 1]], home = [1] }
"carried.turn" = { kind = "R", parent = "carrier", child = "top", axes = [[0, 1, 0]] }
""" + "".join(
    _LEG.format(k=k, foot=foot, head=head) for k, (foot, head) in enumerate(((-0.6, -0.2), (-0.1, 0.3), (0.6, 0.2)), 1)
)

#: Motions of those mechanisms.
CROSSED = "motion.a.polynomial = [0.1, 1, 2]\nmotion.b.harmonics = [[5, 0.3, 0.2]]"
CRANKED = "motion.crank.polynomial = [0.1, 4, 3]"
POSED = (
    "motion.x.harmonics = [[4, 0, 0.2]]\nmotion.z.polynomial = [1, 0.1, -0.2]\nmotion.turn.polynomial = [0, 0.3, 0.2]"
)
FALLING = "[forward]\nstart = { a = 0.3, b = 0.4 }\nrates = { a = 1, b = -2 }"


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
        assert re.search(f"'coupler' has no mass.* {engine}", failure.reason)
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
            "bodies.cross: a body without mass",
        ),
        (
            "mass = 0",
            "mass = 0\ninertia = { xx = 1, yy = 1 }",
            "bodies.cross: a body without mass",
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


#: A wheel that is a point mass at its own hinge, and turns as the arm does by a gear.
GEARED = """
name = "geared"
independent.arm = "arm"
[bodies.arm]
mass = 1
com = [0.5, 0, 0]
inertia = { xx = 0.01, yy = 0.1, zz = 0.1 }
[bodies.wheel]
mass = 2
inertia = { xx = 0, yy = 0, zz = 0 }
[joints.arm]
kind = "R"
parent = "ground"
child = "arm"
axes = [[0, 1, 0]]
[joints.spin]
kind = "R"
parent = "arm"
child = "wheel"
axes = [[0, 1, 0]]
parent_frame.position = [1, 0, 0]
[couplings.gear]
coordinate = "spin"
of = "arm"
polynomial = [0, -3]
"""


def point_mass_coupler() -> str:
    """A point mass at the crank's end."""
    text = 'name = "four-bar"\nindependent.arm = "a"\n' + four_bar([Bar(0.3), Bar(0.6), Bar(0.4)], 0.5, 1.0)
    whole = Bar(0.6).written("coupler")
    assert whole in text
    return text.replace(whole, "[bodies.coupler]\nmass = 1.2\ninertia = { xx = 0, yy = 0, zz = 0 }\n")


@pytest.mark.parametrize(("text", "body"), [(GEARED, "wheel"), (point_mass_coupler(), "coupler")])
def test_a_point_mass_at_its_own_hinge_is_named_where_pinocchio_cannot_accelerate_it(text, body, scene):
    results = screwgauge.run(scene(text, "[forward]\nrates = { arm = 0.5 }"), engines=["screw", "pinocchio", "mujoco"])
    assert {*results.failures} == {"pinocchio"}
    reason = results.failures["pinocchio"].reason
    assert f"'{body}' has no inertia" in reason
    assert "moment of inertia" in reason
    assert results.errors["ok"].all()
