"""Loops as Gazebo's physics tests have them, in files of our own, move alike in four engines of three formulations."""

import re

import pytest

import screwgauge

ENGINES = ("screw", "pinocchio", "mujoco", "lagrange")
#: Digits of all forces and motions that are unique; those of springs that close loops are fewer.
DIGITS = 13.0

HINGE = (
    '<joint name="{}" type="revolute"><pose {} degrees="true">{}</pose><parent>{}</parent><child>{}</child>'
    "<axis><xyz>1 0 0</xyz>{}</axis></joint>"
)
ROD = """<link name="{0}"><pose degrees="true" relative_to="{0}_mount">0.15 0 0 -155 0 0</pose><inertial auto="true"/>
<collision name="hub"><pose degrees="true">0 0 0 0 90 0</pose>{1}</collision>
<collision name="bob"><pose degrees="true" relative_to="{0}_end">0 0 0 0 90 0</pose>{1}</collision>
<collision name="bar"><pose>0 0 0.25 0 0 0</pose><density>5e3</density><geometry><cylinder><radius>0.05</radius>
<length>0.5</length></cylinder></geometry></collision></link>
<frame name="{0}_end" attached_to="{0}"><pose>0 0 0.5 0 0 0</pose></frame>""".format
DISC = "<geometry><cylinder><radius>0.05</radius><length>0.1</length></cylinder></geometry>"
PLATE = '<collision name="c"><geometry><box><size>{}</size></box></geometry></collision>'
#: Two rods on a loose stand that carry a plate; shapes give mass, frames hang on frames.
FOUR_BAR = f"""<model name="four_bar"><pose degrees="true">-4.7 1 0 0 0 180</pose>
<link name="stand"><inertial><pose>-0.19 0 0.76 -0.136 0 1.5708</pose><mass>2500</mass>
<inertia><ixx>154</ixx><iyy>152</iyy><izz>28.8</izz></inertia></inertial></link>
<frame name="top" attached_to="stand"><pose>-0.175 0 3.91 0 0 0</pose></frame>
<frame name="left_mount" attached_to="top"><pose>0 -0.3 -0.05 0 0 0</pose></frame>
<frame name="right_mount" attached_to="top"><pose>0 0.3 -0.05 0 0 0</pose></frame>
{ROD("left", DISC)}{ROD("right", DISC)}
{HINGE.format("upper_left", "", "", "stand", "left", "")}{HINGE.format("upper_right", "", "", "stand", "right", "")}
{HINGE.format("lower_right", 'relative_to="right_end"', "0 0 0 -25 0 0", "right", "plate", "")}
{HINGE.format("lower_left", 'relative_to="left_end"', "0 0 0 -25 0 0", "left", "plate", "")}
<link name="plate"><pose relative_to="lower_left">0 -0.3 0.2 0 0 0</pose><inertial auto="true"/>
{PLATE.format("0.05 1 0.5")}</link></model>"""
MIMIC = '<xyz>1 0 0</xyz><mimic joint="upper_left"><multiplier>{}</multiplier></mimic>'
#: The same by mimics in place of the loop.
MIMICS = re.sub(r'<joint name="lower_right".*?</joint>\n', "", FOUR_BAR)
for child, factor in (("right", 1), ("plate", -1)):
    MIMICS = MIMICS.replace(
        f"<child>{child}</child><axis><xyz>1 0 0</xyz>", f"<child>{child}</child><axis>{MIMIC.format(factor)}"
    )
#: Four plates in a ring that hangs on nothing, and states no mass.
POSES = ("-0.4 0 0 0 0 0", "0 0.4 0.1 0 0 -1.5708", "0.4 0 0 0 0 -3.14159", "0 -0.4 0.1 0 0 1.5708")
RING = [f'<link name="l{i}"><pose>{pose}</pose>{PLATE.format("0.2 1 0.1")}</link>' for i, pose in enumerate(POSES)]
RING += [
    HINGE.format(f"j{i}", "", "0 -0.4 0 0 0 0", f"l{i}", f"l{(i + 1) % 4}", "").replace("1 0 0<", "0 0 1<")
    for i in range(4)
]
FREE_LOOP = f'<model name="ring"><pose>0 0 0.8 1.5708 0.7854 0</pose>{"".join(RING)}</model>'
#: Three bars between two hinges in the world, with resistance in one.
ANCHORED = '<model name="anchored"><link name="a"><pose>0 0 0.2 0.6435 0 0</pose></link>'
ANCHORED += (
    '<link name="b"><pose>0.1 -0.3 0.6 1.5708 0 0</pose></link><link name="c"><pose>0 -0.8 0.6 2.4981 0 0</pose></link>'
)
ENDS = (("world", "a", ""), ("a", "b", ""), ("b", "c", ""), ("world", "c", "0 0 0.5 0 0 0"))
ANCHORED += "".join(HINGE.format(f"j{i}", "", pose, parent, child, "") for i, (parent, child, pose) in enumerate(ENDS))
ANCHORED += "</model>"


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("version", "model"),
    [("1.11", FOUR_BAR), ("1.11", MIMICS), ("1.6", FREE_LOOP), ("1.6", ANCHORED)],
    ids=["four-bar", "mimics", "free loop", "anchored loop"],
)
def test_four_engines_agree_on_a_loop_of_an_sdf(version, model, tmp_path):
    file = tmp_path / "loop.sdf"
    file.write_text(f'<sdf version="{version}"><world name="w">{model}</world></sdf>', encoding="utf-8")
    results = screwgauge.run(screwgauge.load_scene(file), engines=ENGINES)
    assert results.ok, results
    assert not results.failures
    exact = results.errors[results.errors["unique"] & (results.errors["quantity"] != "tree_force_soft")]
    assert exact["max_scaled"].max() < 10**-DIGITS
    assert {*exact["a"], *exact["b"]} == {*ENGINES}
