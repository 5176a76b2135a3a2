"""SDF as its specification has it, where a table of texts and facts does not do: long chains, a capsule, a loop."""

import math

import numpy as np
import pytest

import screwgauge
from support.claims import table
from support.data import DATA
from support.readings import read

ARM = table("readings")["texts"]["sdf"]
BALL = '<joint name="l" type="ball"><parent>b</parent><child>c</child></joint>'
R, L = 0.2, 0.7


@pytest.fixture
def link(write):
    return lambda parts: read(write("m.sdf", ARM.replace("</model>", f"{parts}{BALL}</model>")), "screwgauge").bodies[
        "c"
    ]


def test_frames_may_be_placed_in_each_other_without_end(link):
    n = 3000
    frames = (
        f'<frame name="f{i}"><pose relative_to="f{i - 1}">0 0 0.001 0 0 0</pose></frame>' for i in range(1, n + 1)
    )
    last = f'<link name="c"><pose relative_to="f{n}"/><inertial><mass>1</mass></inertial></link>'
    assert link("".join(['<frame name="f0"/>', *frames, last])).pose[2, 3] == pytest.approx(3.0)


def test_a_capsule_is_a_cylinder_between_two_hemispheres(link):
    """Against a sum over thin discs."""
    shape = f"<capsule><radius>{R}</radius><length>{L}</length></capsule>"
    collision = f"<collision name='s'><geometry>{shape}</geometry></collision>"
    body = link(f"<link name='c'><inertial auto='1'/>{collision}</link>")
    z, step = np.linspace(-L / 2 - R, L / 2 + R, 200001, retstep=True)
    square = R * R - np.maximum(np.abs(z) - L / 2, 0.0) ** 2  # of the radius of each disc
    disc = 1000 * math.pi * square * step
    across, along = (disc * (square / 4 + z * z)).sum(), (disc * square / 2).sum()
    assert body.mass == pytest.approx(disc.sum(), rel=1e-9, abs=0)
    assert np.diag(body.inertia) == pytest.approx([across, across, along], rel=1e-8, abs=0)


def test_a_child_named_twice_closes_a_loop():
    found = read(DATA / "four-bar.sdf", "screwgauge")
    assert {name for body in found.bodies.values() if body.copy_of for name in body.joints} == {"d"}
    assert found.joints["d"].damping == 0.3
    results = screwgauge.run(screwgauge.load_scene(DATA / "four-bar.sdf"), engines=("screw", "pinocchio", "mujoco"))
    assert results.ok, results
    assert not results.failures
