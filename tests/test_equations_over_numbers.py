"""The equations say the same over every kind of number: floats of three lengths, nodes of a trace, and balls.

Balls of 256 bits are the measure: of the same doubles they give the same quantities to 45 digits and more, and what
floats are off by is rounding. It is counted in roundings of the type times the condition number of the closing system.
"""

import importlib.util
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import screwgauge
from screwgauge import load_scene
from support.acting import Applied
from support.at_origin import acceleration_screws, along_tree, inertia, recursion
from support.coupled import EVERY_KIND, every_kind, moving
from support.mechanism import load_mechanism, mechanism_names
from support.numbers import (
    FORWARD,
    NUMPY,
    POWER,
    ROUNDINGS,
    Dynamics,
    Forward,
    State,
    acting,
    around,
    conditions,
    contained,
    equations,
    errors_of,
    in_balls,
    in_floats,
    inputs,
    parts,
    run,
    run_in,
    state,
    swinging,
    traced,
    widest,
)

pytest.importorskip("flint", reason="python-flint is not installed")
needs_llvm = pytest.mark.skipif(not importlib.util.find_spec("llvmlite"), reason="llvmlite is not installed")

EPS = {kind: float(np.finfo(kind).eps) for kind in (np.float32, np.float64, np.longdouble)}
#: Radius of balls that stand for doubles, in units of their last place.
ULPS = 4.0
#: Digits that balls of 256 bits, 77 digits, keep where conditions are up to a thousand.
PROVED = 1e-40


def sprung(name: str, cut: str = "") -> State:
    mechanism = load_mechanism(name)
    at = swinging(mechanism, acting(mechanism), 2)
    names = [joint.name for joint in mechanism.joints if joint.kind == cut]
    return at.over([joint.name for joint in mechanism.joints if joint.name != names[-1]]) if cut else at


def axial() -> State:
    return state(replace(load_scene("3ups-upu-s"), rule="spherical_axial"), 2)


def joints_of_every_kind() -> State:
    with TemporaryDirectory() as folder:

        def write(name: str, text: str) -> Path:
            path = Path(folder) / name
            path.write_text(text, encoding="utf-8")
            return path

        return state(moving(write, every_kind(EVERY_KIND), {"a": 0.3, "b": -0.2}, "H"), 2)


CASES: dict[str, Callable[[], State]] = {
    "R cut, springs and motors": partial(sprung, "five-bar"),
    "R cut of R S U P": partial(sprung, "spatial-slider-crank", "R"),
    "S cut of R S U P": partial(sprung, "spatial-slider-crank", "S"),
    "U cut of R S U P": partial(sprung, "spatial-slider-crank", "U"),
    "P cut of R S U P": partial(sprung, "spatial-slider-crank", "P"),
    "C cut": partial(sprung, "rccc", "C"),
    "redundant loop": partial(sprung, "bennett"),
    "couplings in a loop": lambda: state(load_scene("screw-press")),
    "couplings of gears": lambda: state(load_scene("planetary-gear"), 2),
    "joints of every kind": joints_of_every_kind,
    "no weight": lambda: swinging(load_mechanism("five-bar"), Applied(gravity=np.zeros(3))),
    "free joint in loops": lambda: state(load_scene("stewart"), 1),
    "redundant actuators of smallest norm": lambda: state(load_scene("3ups-upu-s"), 2),
    "redundant actuators by eq. (56)": axial,
    "fewer actuators than freedoms": lambda: state(screwgauge.random(2, "underactuated"), 2),
}
#: Those that take longest, and those whose machine code is made within a second.
SLOW = {"free joint in loops", "fewer actuators than freedoms"}
SHORT = {"R cut, springs and motors", "S cut of R S U P", "couplings in a loop", "couplings of gears"}
NAMES = [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in CASES]
BRIEF = [pytest.param(name, marks=[] if name in SHORT else pytest.mark.slow) for name in CASES]
FLOATS = [pytest.param(number, id=number.__name__) for number in EPS]

posed = cache(lambda name: CASES[name]())
program = cache(lambda name: traced(posed(name)))
true = cache(lambda name: in_balls(posed(name)))
rounding = cache(lambda name: max(conditions(posed(name))))


def check(name: str, found, number, right=None) -> None:
    errors, bound = errors_of(posed(name), found, right or true(name)), ROUNDINGS * EPS[number] * rounding(name)
    assert errors
    assert {each: error for each, error in errors.items() if not error <= bound} == {}


@pytest.mark.parametrize("name", NAMES)
def test_balls_say_what_is_right(name):
    assert widest(true(name)) < PROVED


@pytest.mark.parametrize("name", NAMES)
def test_recursion_in_the_axes_of_bodies_says_what_eq_44_says_at_the_origin(name):
    at = posed(name)
    found, bound = equations(at, Dynamics, NUMPY, at.q, at.yd, at.ydd), ROUNDINGS * EPS[np.float64] * rounding(name)
    A = acceleration_screws(found.pose, found.w, found.beta)
    needs = inertia(found, found.V, A, found.applied.g)
    forms = {
        "accelerations": (found.A, A),
        "inertia": (recursion.at_origin(found.pose, found.required), needs),
        "forces along the tree": (recursion.inward(found.pose, found.required)[0], along_tree(found, needs)),
    }
    for what, (here, there) in forms.items():
        assert np.abs(here - there).max() <= bound * np.abs(there).max(), what


@pytest.mark.parametrize("number", FLOATS)
@pytest.mark.parametrize("name", NAMES)
def test_floats_of_any_length_are_off_by_rounding(name, number):
    found = in_floats(posed(name), number)
    check(name, found, number)
    if number is not np.longdouble:
        assert {values.dtype for values in found.values()} == {np.dtype(number)}


@pytest.mark.parametrize("name", NAMES)
def test_balls_of_what_doubles_may_stand_for_enclose_their_results(name):
    at = posed(name)
    found, enclosures = in_floats(at, np.float64, steps=0), around(at, ULPS)
    for quantity, values in found.items():
        assert contained(values, enclosures[quantity]).all(), quantity


@pytest.mark.parametrize("number", FLOATS)
@pytest.mark.parametrize("name", NAMES)
def test_a_program_is_off_by_the_rounding_of_what_it_runs_in(name, number):
    """Constants are folded in doubles."""
    made, places = program(name)
    least = max(number, np.float64, key=EPS.get) if number is np.longdouble else number
    check(name, parts(run_in(made, number, inputs(posed(name))), places), least)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("backend", ["numpy", pytest.param("llvm", marks=needs_llvm)])
@pytest.mark.parametrize("name", BRIEF)
def test_back_ends_are_off_by_rounding(name, backend):
    made, places = program(name)
    check(name, parts(run(made, backend, inputs(posed(name))), places), np.float64)


@pytest.mark.parametrize("number", FLOATS)
@pytest.mark.parametrize("name", NAMES)
def test_accelerations_for_given_forces_are_off_by_rounding(name, number):
    right = in_balls(posed(name), Forward)
    check(name, in_floats(posed(name), number, Forward), number, right)
    assert {*right} == {FORWARD, POWER}


@pytest.mark.parametrize("name", NAMES)
def test_programs_of_accelerations_are_off_by_rounding(name):
    at = posed(name)
    made, places = traced(at, Forward)
    check(name, parts(run(made, "numpy", inputs(at)), places), np.float64, in_balls(at, Forward))


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("mechanism", [name for name in mechanism_names() if name != "a02-fourbar-40"])
def test_programs_of_every_built_in_mechanism_are_off_by_rounding(mechanism):
    at = swinging(load_mechanism(mechanism), acting(load_mechanism(mechanism)))
    made, places = traced(at)
    errors = errors_of(at, parts(run(made, "numpy", inputs(at)), places), in_balls(at))
    assert max(errors.values()) < ROUNDINGS * EPS[np.float64] * max(conditions(at))
