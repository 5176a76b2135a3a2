"""Forward scenes, springs, motors and observables that cannot be are refused with one sentence."""

from __future__ import annotations

import pytest

GOOD = {
    "mechanism": 'mechanism = "a01-pendulum"',
    "engines": 'engines = ["screw"]',
    "gravity": "gravity = [0, -9.81, 0]",
    "time": "time = { times = [0, 0.1] }",
    "forward": "forward = { start = { angle = '-pi/4' } }",
    "observable": '[[observables]]\nname = "x"\nbody = "bob"\npoint = [0, -1, 0]\naxis = "x"',
    "spring": '[[springs]]\ncoordinate = "pivot"\nstiffness = 1',
    "motor": '[[motors]]\ncoordinate = "pivot"\noffset = 1',
}
MOTION = "motion = { angle = { offset = 0.1 } }"
POINTS = '[[springs]]\nfirst = "bob"\nfirst_point = [0, -1, 0]\nsecond_point = [1, 1, 0]\n'
BAD = {
    "negative stiffness": (
        {"spring": '[[springs]]\ncoordinate = "pivot"\nstiffness = -1'},
        "stiffness -1 is negative",
    ),
    "negative damping": ({"spring": f"{POINTS}damping = '-2'"}, "damping -2 is negative"),
    "negative length": ({"spring": f"{POINTS}stiffness = 1\nrest = -1"}, "rest length -1 m is negative"),
    "spring of nothing": ({"spring": '[[springs]]\ncoordinate = "pivot"'}, "the spring exerts nothing"),
    "spring with both": ({"spring": f'{POINTS}coordinate = "pivot"'}, "either a coordinate or two ends"),
    "spring with neither": ({"spring": "[[springs]]\nstiffness = 1"}, "either a coordinate or two ends"),
    "spring to itself": ({"spring": f'{POINTS}second = "bob"\nstiffness = 1'}, "joins a body to itself"),
    "spring elsewhere": (
        {"spring": '[[springs]]\ncoordinate = "pivit"\nstiffness = 1'},
        "did you mean 'pivot'",
    ),
    "spring at no body": ({"spring": f'{POINTS}second = "bab"\nstiffness = 1'}, "unknown body 'bab'"),
    "spring with a point": (
        {"spring": '[[springs]]\ncoordinate = "pivot"\nstiffness = 1\nsecond = "bob"'},
        "'second' does not belong to a joint's spring",
    ),
    "motor elsewhere": ({"motor": '[[motors]]\ncoordinate = "x"\noffset = 1'}, "unknown coordinate 'x'"),
    "motor of nothing": ({"motor": '[[motors]]\ncoordinate = "pivot"'}, "the motor exerts nothing"),
    "motor with a key": ({"motor": '[[motors]]\ncoordinate = "pivot"\ntorque = 1'}, "unknown key 'torque'"),
    "no force": ({"gravity": "gravity = [0, 0, 0]", "spring": "", "motor": ""}, "nothing exerts a force"),
    "both motions": ({"rule": MOTION}, "'motion' does not belong to a forward scene"),
    "rule": ({"rule": 'rule = "min_norm"'}, "'rule' does not belong to a forward scene"),
    "start elsewhere": ({"forward": "forward = { start = { angel = 1 } }"}, "unknown key 'angel'"),
    "rate of text": ({"forward": "forward = { rates = { angle = 'fast' } }"}, "cannot be read as a number"),
    "method": ({"forward": "forward = { method = 'RK45' }"}, "unknown method 'RK45'"),
    "tolerance": ({"forward": "forward = { rtol = 0 }"}, "0 is not between 1e-14 and 1"),
    "times": ({"time": "time = { times = [0, 0.2, 0.1] }"}, "the times do not increase"),
    "axis": ({"observable": '[[observables]]\nname = "x"\nbody = "bob"\naxis = "w"'}, "unknown axis 'w'"),
    "observable of nothing": (
        {"observable": '[[observables]]\nname = "x"'},
        "either a coordinate or a point",
    ),
    "observable twice": (
        {"observable": 2 * '[[observables]]\nname = "x"\ncoordinate = "pivot"\n'},
        "two observables share a name",
    ),
    "engine": ({"engines": 'engines = ["screw", "truth"]'}, "engine 'truth' does not integrate"),
    "quantity": ({"rule": 'quantities = ["reaction"]'}, "unknown quantity 'reaction'"),
    "reference of nothing": (
        {"observable": "", "rule": 'reference = { file = "a.csv", source = "a" }'},
        "there is nothing that it is the reference of",
    ),
    "reference without a column": (
        {"rule": 'reference = { file = "known.csv", source = "a" }'},
        "column 'x' is missing",
    ),
    "reference at other times": (
        {"rule": 'reference = { file = "late.csv", source = "a" }'},
        "none of the scene's times",
    ),
    "published": (
        {"observable": '[[published]]\nwho = "me"\nsource = "here"\naccuracy = 0'},
        "0 is not positive",
    ),
    "measure": (
        {"observable": '[[published]]\nwho = "me"\nsource = "here"\nof = "speed"'},
        "unknown measure 'speed'",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", BAD)
def test_bad_forward_scene_is_refused(case, write, refused):
    changes, sentence = BAD[case]
    write("known.csv", "t,y\n0,1\n")
    write("late.csv", "t,x\n5,1\n")
    entries = GOOD | changes
    tables = ("observable", "spring", "motor")
    keys = [key for key in entries if key not in tables] + [key for key in tables if entries[key]]
    path = write("scene.toml", "\n".join(entries[key] for key in keys) + "\n")
    assert sentence in refused("run", path)


def test_observables_belong_to_a_forward_scene(write, refused):
    entries = {key: GOOD[key] for key in ("mechanism", "time", "observable")} | {"motion": MOTION}
    path = write("scene.toml", "\n".join(entries[key] for key in ("mechanism", "time", "motion", "observable")))
    assert "'observables' belongs to a forward scene" in refused("run", path)


def test_what_was_not_integrated_cannot_be_asked_for(write, refused):
    path = write("scene.toml", "\n".join(text for key, text in GOOD.items() if key != "observable"))
    assert "there is no observable" in refused("run", path, "--quantities", "observable")
    assert "unknown quantity 'actuator_force'" in refused("run", path, "--quantities", "actuator_force")
    assert "engine 'mujoco-full' does not integrate" in refused("run", path, "--engines", "mujoco-full")
