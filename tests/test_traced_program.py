import numpy as np
import pytest

from support.equations import rotation
from support.traced import Factors, Lanes, NotTraceableError, Trace, apply, program

SAMPLES = np.array([0.3, -0.7, 1.1])


@pytest.fixture
def trace():
    return Trace()


def run(made, *inputs):
    out = np.empty((len(made.outputs), len(inputs[0])))
    Lanes(made, 4).bind([np.array(inputs)], [out])()
    return out


def test_zeros_ones_and_signs_fold(trace):
    x = trace.input(SAMPLES)
    assert 0.0 * x == 0.0
    assert x + 0.0 is x
    assert 1.0 * x is x
    assert x - x == 0.0
    assert trace.neg(-x) is x
    assert (-x) * (-x) is x * x
    assert 2.0 * (3.0 * x) is 6.0 * x


def test_equal_expressions_are_one(trace):
    x, y = trace.input(SAMPLES), trace.input(2.0 * SAMPLES)
    assert x * y + 1.0 is y * x + 1.0
    made = program(2, [x - y, y - x])
    assert [op for op, _ in made.code] == ["sub", "neg"]


def test_what_merely_agrees_in_value_stays_apart(trace):
    """|x| = x at these samples only."""
    x = trace.input(np.abs(SAMPLES))
    size = apply("sqrt", x * x)
    assert np.array_equal(size.value, x.value)
    assert size is not x
    assert run(program(1, [size - x]), [-2.0])[0, 0] == 4.0


def test_what_nobody_wants_is_left_out(trace):
    x = trace.input(SAMPLES)
    wanted, unwanted = x * x, apply("sin", x)
    made = program(1, [wanted])
    assert len(made.code) == 1
    assert unwanted.op == "sin"


def test_a_turn_about_an_axis_of_its_frame_costs_two_numbers(trace):
    s, c = trace.input(SAMPLES), trace.input(SAMPLES)
    turned = rotation(np.array([0.0, 0.0, 1.0]), s, c)
    assert turned.tolist() == [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]


def test_pivots_keep_their_size_at_every_sample(trace):
    home_is_zero = trace.input(np.array([0.0, 0.5, 2.0]))
    fair = trace.input(np.array([0.4, 0.3, 0.5]))
    A = {(0, 0): home_is_zero, (1, 0): fair, (0, 1): fair, (1, 1): home_is_zero}
    factors = Factors(A, [1.0, 1.0], [1.0, 1.0], [[0, 1]])
    assert factors.pivots[0] in {(1, 0), (0, 1)}


def test_a_system_without_such_pivots_is_refused(trace):
    zero_here, zero_there = trace.input(np.array([0.0, 1.0])), trace.input(np.array([1.0, 0.0]))
    with pytest.raises(NotTraceableError, match="no pivot stays large"):
        Factors({(0, 0): zero_here, (1, 0): zero_there}, [1.0, 1.0], [1.0], [[0]])


def test_elimination_solves_both_ways(trace):
    rng = np.random.default_rng(3)
    M = rng.normal(size=(5, 4, 4)) * (rng.random((4, 4)) < 0.7) + 3.0 * np.eye(4)
    b = rng.normal(size=(5, 4))
    A = {(i, j): trace.input(M[:, i, j]) for i in range(4) for j in range(4) if M[0, i, j]}
    right = [trace.input(column) for column in b.T]
    factors = Factors(A, [1.0] * 4, [1.0] * 4, [range(4)])
    x = factors.solve(right)
    found = np.stack([x[i].value for i in range(4)], axis=1)
    assert np.abs(found - np.linalg.solve(M, b[..., None])[..., 0]).max() < 1e-13
    back = np.stack([z.value for z in factors.solve_transposed(dict(enumerate(right)))], axis=1)
    assert np.abs(back - np.linalg.solve(M.swapaxes(1, 2), b[..., None])[..., 0]).max() < 1e-13


def test_lanes_run_any_number_of_samples(trace):
    x, y = trace.input(SAMPLES), trace.input(SAMPLES)
    made = program(2, [x * y + apply("cos", x), 2.5, x])
    inputs = np.random.default_rng(1).normal(size=(2, 11))
    found = run(made, *inputs)
    expected = inputs[0] * inputs[1] + np.cos(inputs[0]), np.full(11, 2.5), inputs[0]
    assert np.array_equal(found, expected)


def test_a_program_can_be_read_as_c(trace):
    x = trace.input(SAMPLES)
    text = program(1, [apply("sin", x) * x, 0.5]).as_c("legs")
    assert text.splitlines() == [
        "void legs(const double *x, double *out)",
        "{",
        "    double v1 = sin(x[0]);",
        "    double v2 = x[0] * v1;",
        "    out[0] = v2;",
        "    out[1] = 0.5;",
        "}",
    ]
