"""A description that is no mechanism is refused in one sentence that names the file and the entry."""

from __future__ import annotations

import numpy as np
import pytest

from screwgauge import ScrewgaugeError, load_scene, run, stream
from screwgauge.api import compile
from support.errors import DescriptionError
from support.geometry import linear, number, rotation
from support.mechanism import Body, load_mechanism
from support.scene import check_home
from support.solve import at_home, motion_at
from support.tolerances import PLACED

ROD = """
name = "rod"
[independent]
a = "hinge"
[bodies.rod]
mass = 2
inertia = { xx = 1, yy = 1 }
[joints.hinge]
kind = "R"
parent = "ground"
child = "rod"
axes = [[0, 1, 0]]
actuated = true
"""
ROD_SCENE = 'mechanism = "rod.toml"\nmotion = { a = { offset = 0.1 } }\ntime = { times = [0] }\n'


@pytest.fixture
def rod(write):
    """The scene of a rod on a hinge, one piece of its description replaced. Returns the path."""

    def make(old: str = "", new: str = ""):
        assert old in ROD
        write("rod.toml", ROD.replace(old, new, 1) if old else ROD + new)
        return write("scene.toml", ROD_SCENE)

    return make


def test_the_rod_itself_is_accepted(rod):
    assert load_mechanism(rod().with_name("rod.toml")).name == "rod"


@pytest.mark.parametrize("command", ["run", "models"])
def test_unknown_mechanism_is_refused(command, refused, write):
    scene = write("scene.toml", ROD_SCENE.replace("rod.toml", "3ups-upu"))
    said = refused("run", scene) if command == "run" else refused("models", "3ups-upu")
    assert "unknown mechanism '3ups-upu'" in said
    assert "did you mean '3ups-upu-s'" in said


@pytest.mark.parametrize("name", ["x" * 5000, "", ".", "\udcff"])
def test_what_is_no_path_is_an_unknown_mechanism(name):
    with pytest.raises(ScrewgaugeError, match="unknown mechanism"):
        load_mechanism(name)


@pytest.mark.parametrize("text", ["mass = = 2", "[bodies", "a = 1\na = 2", "x = " + "[" * 20000, "x = " + "1" * 5000])
def test_toml_syntax_error_names_the_file(text, rod, refused):
    said = refused("run", rod("mass = 2", text))
    assert "rod.toml: " in said


def test_toml_syntax_error_names_the_line(rod, refused):
    assert "TOML syntax error" in refused("run", rod("mass = 2", "mass = "))


def test_binary_file_is_refused(tmp_path, refused):
    (tmp_path / "m.toml").write_bytes(b"\xff\xfe\x00")
    assert "is not UTF-8 text" in refused("models", tmp_path / "m.toml")


@pytest.mark.parametrize(
    ("old", "new", "entry", "hint"),
    [
        ('name = "rod"', 'name = "rod"\nbodys = 1', "rod.toml", "did you mean 'bodies'?"),
        ("mass = 2", "mass = 2\nmas = 3", "bodies.rod", "did you mean 'mass'?"),
        ("xx = 1", "xx = 1, zx = 0", "bodies.rod.inertia", "choose one of: xx, xy, xz, yy, yz, zz"),
        ('kind = "R"', 'kind = "R"\naxis = [0, 0, 1]', "joints.hinge", "did you mean 'axes'?"),
        (
            'kind = "R"',
            'kind = "R"\nparent_frame = { pos = [0, 0, 0] }',
            "joints.hinge.parent_frame",
            "position",
        ),
        ('name = "rod"', 'name = "rod"\nspherical_axial = { join = "hinge" }', "spherical_axial", "'joint'"),
    ],
)
def test_unknown_key_is_refused_with_the_nearest_known(old, new, entry, hint, rod, refused):
    said = refused("run", rod(old, new))
    assert "unknown key" in said
    assert f"{entry}: " in said
    assert hint in said


@pytest.mark.parametrize(
    ("old", "entry"),
    [
        ('name = "rod"', "'name'"),
        ("[bodies.rod]\nmass = 2\ninertia = { xx = 1, yy = 1 }", "'bodies'"),
        ('[independent]\na = "hinge"', "'independent'"),
        ("mass = 2", "'mass'"),
        ("inertia = { xx = 1, yy = 1 }", "'inertia'"),
        ('kind = "R"', "'kind'"),
        ('parent = "ground"', "'parent'"),
        ('child = "rod"', "'child'"),
        ("axes = [[0, 1, 0]]", "'axes'"),
    ],
)
def test_missing_entry_is_named(old, entry, rod, refused):
    assert f"{entry} is missing" in refused("run", rod(old, ""))


@pytest.mark.parametrize("side", ["parent", "child"])
def test_joint_to_a_body_that_does_not_exist_is_refused(side, rod, refused):
    old = {"parent": 'parent = "ground"', "child": 'child = "rod"'}[side]
    said = refused("run", rod(old, f'{side} = "rot"'))
    assert "joints.hinge: unknown body 'rot'" in said
    assert "Known: ground, rod" in said or "did you mean 'rod'" in said


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ('parent = "ground"', 'parent = "rod"', "joins 'rod' to itself"),
        ("", "[bodies.free]\nmass = 1\ninertia = {}", "body 'free' is not connected to ground"),
        ("", "[bodies.ground]\nmass = 1\ninertia = {}", "'ground' is the fixed world"),
        ("", "[bodies.environment]\nmass = 1\ninertia = {}", "'environment' is who exerts the loads of a scene"),
        ("", '[joints.b]\nkind = "R"\nparent = "ground"\nchild = "rod"\naxes = [[0, 1, 0]]\ncoordinates = ["hinge"]',
         "two coordinates are called 'hinge'"),
        ('"R"\n', '"U"\n', "a U joint has 2 axes"),
        ('"R"\n', '"X"\n', "unknown joint kind 'X'"),
        ('"R"\n', '["R"]\n', "unknown joint kind"),
        ('"R"\n', '"R"\nhome = [0, 0]\n', "is not a list of 1 number; write 1 number in brackets, such as [0]"),
        ('"R"\n', '"R"\nlimits = [[1, -1]]\n', "has low >= high"),
        ('"R"\n', '"R"\nlimits = [-1, 1]\n', "expected 1 pairs [low, high]"),
        ('"R"\n', '"R"\ncoordinates = ["a", "b"]\n', "has 1 coordinates"),
        ("actuated = true", "actuated = 1", "'1' is not true or false"),
        ('"R"\nparent = "ground"\nchild = "rod"\naxes = [[0, 1, 0]]',
         '"U"\nparent = "ground"\nchild = "rod"\naxes = [[0, 1, 0], [0, 0.6, 0.8]]', "cannot be actuated"),
        ("mass = 2", "mass = 2\ninertia_rotation = { matrix = [[1, 0, 0], [0, 1, 0], [0, 0, -1]] }", "not a rotation"),
        ("mass = 2", "mass = 2\ninertia_rotation = { axis = [0, 0, 1] }", "is not understood"),
        ('name = "rod"', 'name = "rod"\nspherical_axial = { joint = "x", direction = [0, 0, 1] }', "unknown joint 'x'"),
        ('name = "rod"', 'name = "rod"\nspherical_axial = { joint = "hinge", direction = [0, 0, 1] }', "not spherical"),
    ],
)  # fmt: skip
def test_a_graph_that_is_none_is_refused(old, new, what, rod, refused):
    assert what in refused("run", rod(old, new))


def test_orthogonality_of_composite_axes_is_asked_for(changed_scene, refused):
    said = refused("run", changed_scene('[joints."leg1.base"]\naxes = [[1, 0, 0], [0.6, 0.8, 0]]'))
    assert "joints.leg1.base: the axes of a composite joint are not orthogonal" in said


@pytest.mark.parametrize("name", ["../rod", "a/b", "a b", "a@b", 'a"b', "a<b", "a\\nb", "-x", ".", " "])
def test_a_name_that_cannot_stand_in_files_is_refused(name, rod, refused):
    text = name.replace('"', '\\"')
    assert "is not a name" in refused("run", rod('name = "rod"', f'name = "{text}"'))
    assert "is not a name" in refused("run", rod("", f'[bodies."{text}"]\nmass = 1\ninertia = {{}}'))


@pytest.mark.parametrize(
    "mass", ["-1e-9", "-1.5", "nan", "inf", "-inf", '"heavy"', "true", "[1]", "{}", '"0-1"', '"1e400"']
)
def test_mass_that_is_negative_or_no_number_is_refused(mass, rod, refused):
    said = refused("run", rod("mass = 2", f"mass = {mass}"))
    assert "rod.toml, bodies.rod" in said
    assert "is not positive" in said or "cannot be read as a number" in said


@pytest.mark.parametrize(
    "inertia",
    [
        "xx = -1e-3, yy = 1, zz = 1",
        "xx = 1, yy = 1, zz = 1, xy = 1.5",
        "xx = -1, yy = -1, zz = -1",
        "xy = 1e-3",
    ],
)
def test_inertia_that_is_not_positive_semidefinite_is_refused(inertia, rod, refused):
    said = refused("run", rod("xx = 1, yy = 1", inertia))
    assert "bodies.rod: inertia is not positive semidefinite" in said


@pytest.mark.parametrize("inertia", ["xx = 1, yy = 1, zz = 3", "zz = 1", "xx = 0.5, yy = 0.5, zz = 1.00000000001"])
def test_inertia_against_the_triangle_inequality_is_refused(inertia, rod, refused):
    said = refused("run", rod("xx = 1, yy = 1", inertia))
    assert "violate the triangle inequality" in said


def body(*moments: float) -> Body:
    return Body("b", 1.0, np.zeros(3), np.diag(moments))


@pytest.mark.parametrize("moments", [(0, 0, 0), (0, 1, 1), (1e-9, 1e-9, 0), (1, 1, 2), (0.5, 0.5, 1.0), (1e9, 0, 1e9)])
def test_points_and_thin_rods_and_discs_are_legal(moments):
    assert body(*moments).mass == 1.0


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_the_triangle_inequality_has_a_tolerance_of_1e_12_of_the_trace(scale):
    inside, outside = 0.9e-12, 1.1e-12
    body(0.5 * scale, 0.5 * scale, scale * (1 + 2 * inside))
    with pytest.raises(DescriptionError, match="triangle"):
        body(0.5 * scale, 0.5 * scale, scale * (1 + 2 * outside))
    body(scale, scale, -2 * inside * scale)  # the same slack keeps a rounded rod legal
    with pytest.raises(DescriptionError, match="semidefinite"):
        body(scale, scale, -2.2 * outside * scale)


def test_a_rod_turned_into_any_axes_stays_legal():
    for angle in np.linspace(0.1, 3.0, 17):
        R = rotation(np.array([0.6, 0.0, 0.8]), np.array(angle)) @ rotation(
            np.array([0.0, 1.0, 0.0]), np.array(2 * angle)
        )
        Body("rod", 1.0, np.zeros(3), R @ np.diag([0.0, 1.0, 1.0]) @ R.T)


@pytest.mark.parametrize(
    ("axis", "remedy"),
    [
        *((axis, "not 1; divide by its norm") for axis in ("[0, 2, 0]", "[0, 0.999999999, 0]", "[1, 1, 0]")),
        ('["1/sqrt(2)", 0.7071, 0]', "not 1; divide by its norm"),
        ("[0, 0, 0]", "zero; give a unit vector"),
    ],
)
def test_an_axis_that_is_no_unit_vector_is_refused(axis, remedy, rod, refused):
    said = refused("run", rod("[[0, 1, 0]]", f"[{axis}]"))
    assert "joints.hinge.axes: " in said
    assert remedy in said


def test_a_unit_axis_may_be_written_as_an_expression(rod):
    path = rod("[[0, 1, 0]]", '[["1/sqrt(2)", "sqrt(2)/2", 0]]').with_name("rod.toml")
    assert np.linalg.norm(load_mechanism(path).joints[0].axes) == pytest.approx(1.0, abs=PLACED)


def dependent(mechanism, pair: tuple[str, str]) -> bool:
    """Whether two coordinates together leave a freedom of the closed loops at home, by the rank of their rates."""
    lay, home = at_home(mechanism)
    rates = motion_at(lay, home, np.zeros((1, 2))).joint_map[0]
    return linear.rank(rates[mechanism.columns(pair)]) < 2


@pytest.mark.parametrize("pair", [("leg1.q1", "s.q1"), ("leg1.q2", "s.q2"), ("leg1.q3", "leg3.q3"), ("s.q3", "s.q1")])
def test_dependent_coordinates_are_refused(pair, paper, changed_scene, refused):
    assert dependent(paper, pair)
    said = refused("run", changed_scene(f'[independent]\na = "{pair[0]}"\nb = "{pair[1]}"'))
    assert f"changed.toml, independent: the coordinates a = {pair[0]}, b = {pair[1]} are not independent" in said


@pytest.mark.parametrize("pair", [("s.q1", "s.q2"), ("leg1.q3", "leg2.q3")])
def test_independent_coordinates_are_accepted(pair, paper, changed_scene):
    assert not dependent(paper, pair)
    path = changed_scene(f'[independent]\na = "{pair[0]}"\nb = "{pair[1]}"').with_name("changed.toml")
    check_home(load_mechanism(path))


def test_too_many_independent_coordinates_are_refused(changed_scene, refused):
    motion = "motion = { a = {}, b = {}, c = {} }"
    said = refused("run", changed_scene('[independent]\na = "s.q1"\nb = "s.q2"\nc = "s.q3"', motion=motion))
    assert "3 independent coordinates" in said
    assert "for 2 degrees of freedom" in said


def test_too_few_independent_coordinates_are_refused(rod, refused):
    ball = rod(
        '"R"\nparent = "ground"\nchild = "rod"\naxes = [[0, 1, 0]]\nactuated = true',
        '"U"\nparent = "ground"\nchild = "rod"\naxes = [[0, 1, 0], [1, 0, 0]]\ncoordinates = ["hinge", "x"]',
    )
    assert "1 independent coordinates (a = hinge) for 2 degrees of freedom" in refused("run", ball)


@pytest.mark.parametrize(
    ("entry", "what"),
    [
        ('a = "hing"', "independent.a: unknown coordinate 'hing'; did you mean 'hinge'?"),
        ('a = "hinge"\nb = "hinge"', "independent: one coordinate is named twice"),
        ("a = 1", "unknown coordinate '1'"),
        ('a = ["hinge"]', "unknown coordinate"),
        ("", "'independent' has no entries"),
    ],
)
def test_independent_coordinates_that_are_none_are_refused(entry, what, rod, refused):
    assert what in refused("run", rod('a = "hinge"', entry))


@pytest.mark.parametrize("base", ['"rod.toml"', '"./rod.toml"', '"other.toml"'])
def test_a_description_that_extends_itself_is_refused(base, rod, write, refused):
    write("other.toml", f'extends = "../{rod().parent.name}/rod.toml"')
    assert "extends itself" in refused("run", rod('name = "rod"', f'name = "rod"\nextends = {base}'))


@pytest.mark.parametrize("base", ['"nothing"', '"nothing.toml"', "1", "[]", '""'])
def test_a_base_that_does_not_exist_is_refused(base, rod, refused):
    said = refused("run", rod('name = "rod"', f'name = "rod"\nextends = {base}'))
    assert "unknown mechanism" in said or "is not text" in said or "nothing.toml: cannot be read" in said


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('name = "rod"', "name = 3"),
        ('name = "rod"', 'name = "rod"\ntitle = []'),
        ('name = "rod"', 'name = "rod"\nsource = {}'),
        ("[bodies.rod]", "[bodies]\nother = 1\n[bodies.rod]"),
        ("[joints.hinge]", '[joints]\nother = "hinge"\n[joints.hinge]'),
        ("mass = 2", "mass = 2\ncom = [0, 0]"),
        ("mass = 2", "mass = 2\ncom = [0, true, 0]"),
        ("mass = 2", "mass = 1979-05-27"),
        ("mass = 2", 'mass = 2\ncom = "0, 0, 0"'),
        ("mass = 2", "mass = 2\ncom = [[0], [0], [0]]"),
        ("{ xx = 1, yy = 1 }", "[1, 1, 0]"),
        ("{ xx = 1, yy = 1 }", '"solid"'),
        ("xx = 1", "xx = {}"),
        ('kind = "R"', "kind = {}"),
        ('parent = "ground"', "parent = 0"),
        ('child = "rod"', 'child = ["rod"]'),
        ("[[0, 1, 0]]", "[0, 1, 0]"),
        ("[[0, 1, 0]]", '"y"'),
        ("[[0, 1, 0]]", "[[0, 1, 0], [0, 0, 1]]"),
        ("[[0, 1, 0]]", "[[[0], [1], [0]]]"),
        ('kind = "R"', 'kind = "R"\nparent_frame = [0, 0, 0]'),
        ('kind = "R"', 'kind = "R"\nparent_frame = { rotation = 1 }'),
        ('kind = "R"', 'kind = "R"\nparent_frame = { rotation = { axis = 1, angle = 1 } }'),
        ('kind = "R"', 'kind = "R"\nparent_frame = { rotation = { matrix = [1, 2, 3] } }'),
        ('kind = "R"', 'kind = "R"\ncoordinates = "hinge"'),
        ('kind = "R"', 'kind = "R"\ncoordinates = [1]'),
        ('kind = "R"', 'kind = "R"\nhome = 0'),
        ('kind = "R"', 'kind = "R"\nlimits = "none"'),
        ('name = "rod"', 'name = "rod"\nspherical_axial = "hinge"'),
    ],
)
def test_a_value_of_the_wrong_type_is_refused(old, new, rod, refused):
    assert "rod.toml" in refused("run", rod(old, new))


@pytest.mark.parametrize(
    "text",
    ["__import__('os')", "().__class__", "x", "1 +", "1; 2", "1\n2", "1 if 1 else 2", "1if 1else 2", "lambda: 1", "[1]",
     "'1'", "sqrt", "sqrt(-1)", "sqrt(1, 2)", "sqrt(x=1)", "(-8)**0.5", "sqrt((-8)**0.5)", "asin(2)", "1/0", "0**-1",
     "9**9**9", "1e400", "1e101", "nan", "inf", "1j", "True", "0x", "pi()", "eval('1')", "", " ", "\0", "1_", "1,2",
     "(" * 500 + "1" + ")" * 500, "-" * 100_000 + "1", "1" + "+1" * 100_000, "9" * 5000],
    ids=lambda text: repr(text)[:24],
)  # fmt: skip
def test_what_is_no_number_is_refused_in_one_short_sentence(text):
    with pytest.raises(DescriptionError) as caught:
        number(text, "file, entry")
    assert str(caught.value).startswith("file, entry: ")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 600


@pytest.mark.parametrize("value", [True, False, None, [], {}, [1], {"x": 1}, 1j, b"1", object()])
def test_what_is_no_text_and_no_number_is_refused(value):
    with pytest.raises(DescriptionError):
        number(value, "here")


@pytest.mark.parametrize(
    ("text", "value"),
    [("3*sqrt(3)/10", 0.3 * 3**0.5), ("-pi/6", -np.pi / 6), (" 2**-3 ", 0.125), ("1e-3", 1e-3)],
)
def test_expressions_are_read(text, value):
    assert number(text, "") == pytest.approx(value, rel=PLACED, abs=0)


def test_debug_shows_the_traceback_and_still_exits_with_2(command):
    said = command("run", "nothing", "--debug", status=2).err
    assert "Traceback" in said
    assert "unknown scene 'nothing'" in said


@pytest.mark.slow
@pytest.mark.parametrize(("idle", "driven"), [((1, 2, 3, 4), 0), ((2, 3, 4), 1), ((2, 4), 1)])
def test_actuators_that_cannot_make_the_motion_are_refused(idle, driven, changed_scene, refused):
    changes = "".join(f'[joints."leg{leg}.slide"]\nactuated = false\n' for leg in idle)
    scene = changed_scene(changes)
    said = refused("run", scene, "--engines", "screw", "--quantities", "actuator_force,joint_position")
    assert f"changed.toml: the actuated joints drive {driven} of 2 freedoms" in said
    # where nobody chose, what they cannot make is left out, and said to be
    results = run(load_scene(scene).at([0.0]), ["screw"])
    (solution,) = (solution for _, solution in stream(load_scene(scene), [np.zeros(1)]))
    solver = compile(load_scene(scene), backend="numpy")
    answers = (results.solutions["screw"].values, solution.values, solver.components)
    for values, said in zip(answers, (results.warnings, solution.notes, solver.notes), strict=True):
        assert {"actuator_force", "reaction"}.isdisjoint({*values})
        assert f"actuator_force and reaction are left out: the actuated joints drive {driven} of 2 freedoms" in said[0]


def test_a_mechanism_without_actuators_still_moves(changed_scene):
    changes = "".join(f'[joints."leg{leg}.slide"]\nactuated = false\n' for leg in (1, 2, 3, 4))
    scene = load_scene(changed_scene(changes))
    wanted = ["joint_acceleration", "generalized_force"]
    assert run(scene, engines=["screw", "pinocchio", "mujoco"], quantities=wanted).exit_status == 0


@pytest.mark.parametrize("idle", [(4,), (3, 4)])
def test_the_axial_rule_needs_as_many_redundant_actuators_as_it_fixes(idle, changed_scene, refused):
    changes = "".join(f'[joints."leg{leg}.slide"]\nactuated = false\n' for leg in idle)
    said = refused("run", changed_scene(changes, rule='rule = "spherical_axial"'))
    assert f"rule spherical_axial needs 2 redundant actuators, not {2 - len(idle)}" in said
