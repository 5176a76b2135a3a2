"""Couplings of files: driven joints lead, equalities that bite each other's tail are resolved, chains are kept."""

from __future__ import annotations

import pytest

import screwgauge
from support.command import main
from support.judging import agreed
from support.models import import_model

JOINTS = ("pitch", "roll", "left", "right")
AXES = ("0 1 0", "1 0 0", "0 1 0", "0 1 0")


def part(name: str, axis: str, inside: str = "") -> str:
    inertial = '<inertial pos="0 0.02 0.1" mass="0.5" diaginertia="2e-3 3e-3 1.5e-3"/>'
    return f'<body name="of {name}">{inertial}<joint name="{name}" axis="{axis}"/>{inside}</body>'


def mjcf(*equalities: str, driven: tuple[str, ...] = ("left", "right")) -> str:
    """A wrist and two motors beside it; an equality is that of joints, or of the tendon of its name."""
    pitch, roll, left, right = JOINTS
    bodies = part(pitch, AXES[0], part(roll, AXES[1])) + part(left, AXES[2]) + part(right, AXES[3])
    tendons = [each for each in equalities if each.startswith("<fixed")]
    names = [each.split('"')[1] for each in tendons]
    held = [f'<tendon name="{name}" tendon1="{name}"/>' for name in names]
    held += [each for each in equalities if each not in tendons]
    motors = "".join(f'<motor name="of {name}" joint="{name}"/>' for name in driven)
    return (
        f"<mujoco><worldbody>{bodies}</worldbody><tendon>{''.join(tendons)}</tendon>"
        f"<equality>{''.join(held)}</equality><actuator>{motors}</actuator></mujoco>"
    )


def tendon(name: str, **shares: float) -> str:
    parts = "".join(f'<joint joint="{joint}" coef="{share}"/>' for joint, share in shares.items())
    return f'<fixed name="{name}">{parts}</fixed>'


DIFFERENTIAL = (tendon("one", left=2, pitch=-2, roll=-2), tendon("two", right=1, pitch=-1, roll=1))
CASES = {
    "a belt": ((tendon("belt", left=1, pitch=1, right=-1),), {"belt": {"pitch": {"left": -1.0, "right": 1.0}}}),
    "a differential": (
        DIFFERENTIAL,
        {"one": {"pitch": {"left": 0.5, "right": 0.5}}, "two": {"roll": {"left": 0.5, "right": -0.5}}},
    ),
    "said twice": (
        (*DIFFERENTIAL, tendon("three", left=1, right=1, pitch=-2)),
        {"one": {"pitch": {"left": 0.5, "right": 0.5}}, "two": {"roll": {"left": 0.5, "right": -0.5}}},
    ),
    "a driven joint that follows": (
        ('<joint name="gear" joint1="left" joint2="pitch" polycoef="0 4 0 0 0"/>',),
        {"gear": {"pitch": {"left": 0.25}}},
    ),
    "one joint that follows twice": (
        (
            '<joint name="a" joint1="pitch" joint2="left" polycoef="0 2 0 0 0"/>',
            '<joint name="b" joint1="pitch" joint2="roll" polycoef="0 4 0 0 0"/>',
        ),
        {"a": {"pitch": {"left": 2.0}}, "b": {"roll": {"pitch": 0.25}}},
    ),
    "a chain": (
        (
            '<joint name="a" joint1="pitch" joint2="left" polycoef="0 2 0 0 0"/>',
            '<joint name="b" joint1="roll" joint2="pitch" polycoef="0 3 0 0 0"/>',
        ),
        {"a": {"pitch": {"left": 2.0}}, "b": {"roll": {"pitch": 3.0}}},
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_driven_joints_lead(name, write):
    equalities, expected = CASES[name]
    found = import_model(write("wrist.xml", mjcf(*equalities)))
    couplings = {one.name: {one.coordinate: one.function.slopes} for one in found.mechanism.couplings}
    assert couplings == expected
    assert {*found.mechanism.independent.values()} >= {"left"}


@pytest.mark.parametrize("name", ["a belt", "a differential", "said twice"])
def test_the_imported_machine_is_that_of_the_file(name, write, tmp_path):
    file = write("wrist.xml", mjcf(*CASES[name][0]))
    assert main(["import", str(file), "--out", str(tmp_path / "out.toml")]) == 0
    assert screwgauge.diagnose(file, tmp_path / "out.toml").same
    agreed(screwgauge.run(screwgauge.load_scene(tmp_path / "out.scene.toml")))
