from pathlib import Path

import pytest

from screwgauge.casebook.book import CASES
from screwgauge.models.readings.anchors import CASE
from support.mechanism import mechanism_names

ROCKER = '<geom type="capsule" fromto="0 0 0 0 0 .4" size=".01" mass=".4"/>'
SITE, INERTIAL = '<site pos="0 0 .4"/>', '<inertial pos="0 0 .2" mass=".4" diaginertia=".01 .01 .001"/>'
#: In the first the tip of the coupler lies at that of the rocker, in the second 0.42 m from it.
CLOSED, OPEN = "0.65 0 -.4", "0.38 0 -.078"


def write(
    folder: Path, at: str, rocker: str = ROCKER + SITE, closure: str = 'body1="coupler" body2="rocker" anchor=".5 0 0"'
) -> Path:
    bar = '<geom type="capsule" fromto="0 0 0 {0} 0 0" size=".01" mass=".2"/>'
    coupler = (
        f'<body name="coupler" pos=".15 0 0"><joint axis="0 1 0"/>{bar.format(0.5)}<site name="p" pos=".5 0 0"/></body>'
    )
    crank = f'<body name="crank"><joint name="a" axis="0 1 0"/>{bar.format(0.15)}{coupler}</body>'
    standing = f'<body name="rocker" pos="{at}"><joint axis="0 1 0"/>{rocker}</body>'
    closing = f'<equality><connect {closure}/></equality><actuator><motor joint="a"/></actuator>'
    text = f"<mujoco><worldbody>{crank}{standing}</worldbody>{closing}</mujoco>"
    file = folder / "four-bar.xml"
    file.write_text(text, encoding="utf-8")
    return file


def said(text: str) -> list[str]:
    return [line for line in text.splitlines() if CASE in line]


def test_the_case_is_in_the_casebook():
    assert CASE in CASES


def test_import_names_point_body_distance_and_case(tmp_path, command):
    (line,) = said(command("import", str(write(tmp_path, OPEN)), "--out", str(tmp_path / "out.toml")).out)
    for part in ("connect_1", "(0.27, 0, 0.078) m in rocker", "every geom and site of rocker", "0.26 m"):
        assert part in line
    assert "connect-anchor-at-qpos0" in (tmp_path / "out.toml").read_text(encoding="utf-8").replace("\n# ", " ")


def test_a_run_of_the_file_names_it_too(tmp_path, inside, command):
    ran = command("run", str(write(tmp_path, OPEN)), "--engines", "screw", "--quantities", "joint_position")
    assert len(said(ran.err)) == 1


@pytest.mark.parametrize(
    ("at", "rocker", "closure"),
    [
        (CLOSED, ROCKER + SITE, 'body1="coupler" body2="rocker" anchor=".5 0 0"'),
        (CLOSED, INERTIAL + SITE, 'body1="coupler" body2="rocker" anchor=".5 0 0"'),
        (OPEN, INERTIAL, 'body1="coupler" body2="rocker" anchor=".5 0 0"'),  # nothing that it could be off
        (OPEN, ROCKER + '<site name="q" pos="0 0 .4"/>', 'site1="p" site2="q"'),  # as it was meant
        (OPEN, ROCKER + '<site pos="0.27 0 0.078"/>', 'body1="coupler" body2="rocker" anchor=".5 0 0"'),
    ],
)
def test_nothing_is_said_of_points_on_their_bodies(at, rocker, closure, tmp_path, command):
    assert (
        said(command("import", str(write(tmp_path, at, rocker, closure)), "--out", str(tmp_path / "o.toml")).out) == []
    )


def test_what_is_fixed_to_a_body_counts(tmp_path, command):
    tip = '<body pos="0.27 0 0.078"><geom type="sphere" size=".02" mass=".1"/></body>'
    assert (
        said(command("import", str(write(tmp_path, OPEN, ROCKER + tip)), "--out", str(tmp_path / "o.toml")).out) == []
    )


def test_bodies_with_meshes_are_not_judged(tmp_path, command):
    file = write(tmp_path, OPEN, INERTIAL + ROCKER + '<geom type="mesh" mesh="arm"/>')
    text = file.read_text(encoding="utf-8")
    mesh = '<asset><mesh name="arm" file="arm.stl"/></asset>'
    file.write_text(text.replace("<worldbody>", f"{mesh}<worldbody>"), encoding="utf-8")
    assert said(command("import", str(file), "--out", str(tmp_path / "o.toml")).out) == []


# files of forty four-bars say what those of two say, and take as long as all others
@pytest.mark.sampled(9)
@pytest.mark.parametrize("name", [name for name in mechanism_names() if name != "a02-fourbar-40"])
def test_nothing_is_said_of_our_own_files(name, tmp_path, command):
    command("models", name, "--out", str(tmp_path))
    for file in tmp_path.glob("*.xml"):
        assert said(command("import", str(file), "--out", str(tmp_path / f"{file.stem}-again.toml")).out) == []
