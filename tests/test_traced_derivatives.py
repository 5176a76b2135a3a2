import numpy as np
import pytest

from support.traced import Function, Node, NotTraceableError, Trace, adjoints, apply, substitute, tangents

STEP = 1e-30


def expression(x, y, z):
    a = apply("sin", x * y) / (2.0 + z * z) - apply("sqrt", y + 3.0)
    b = apply("cos", a - z) * a
    return [a, b, -(b / x) + a * a + 0.5 * z, 1.0 / (b + 4.0)]


@pytest.fixture
def traced():
    trace = Trace()
    inputs = [trace.input(np.ones(1)) for _ in range(3)]
    return inputs, expression(*inputs)


AT = np.random.default_rng(3).uniform(0.3, 1.2, (5, 3))


def values(inputs, outputs):
    return Function({"x": inputs}, {"out": outputs})(len(AT), x=AT)["out"]


def steps(k):
    """Complex steps of input k."""
    moved = AT.astype(complex)
    moved[:, k] += 1j * STEP
    return np.stack(expression(*moved.T), axis=1).imag / STEP


@pytest.mark.parametrize("k", range(3))
def test_forward_mode_is_a_complex_step(traced, k):
    inputs, outputs = traced
    assert values(inputs, tangents(outputs, {inputs[k]: 1.0})) == pytest.approx(steps(k), rel=1e-13, abs=0)


def test_reverse_mode_is_the_weighted_sum_of_complex_steps(traced):
    inputs, outputs = traced
    weights = [1.0, inputs[0], -2.0, 0.5]  # a weight may be a number of the trace, and counts as constant
    found = values(inputs, adjoints(zip(outputs, weights, strict=True), inputs))
    factors = np.stack([np.ones(5), AT[:, 0], np.full(5, -2.0), np.full(5, 0.5)], axis=1)
    assert found == pytest.approx(
        np.stack([(factors * steps(k)).sum(axis=1) for k in range(3)], axis=1), rel=1e-13, abs=0
    )


def test_derivatives_have_derivatives(traced):
    inputs, outputs = traced
    rate = tangents(outputs, dict.fromkeys(inputs, 1.0))
    twice = values(inputs, tangents(rate, dict.fromkeys(inputs, 1.0)))
    for i, number in enumerate(rate):
        assert twice[:, i] == pytest.approx(
            values(inputs, adjoints([(number, 1.0)], inputs)).sum(axis=1), rel=1e-12, abs=0
        )


def test_a_direction_has_derivatives_by_both_of_its_parts():
    trace = Trace()
    y, x = (trace.input(np.ones(1)) for _ in range(2))
    found = Function({"x": [y, x]}, {"out": adjoints([(apply("atan2", y, x), 1.0)], [y, x])})(5, x=AT[:, :2])["out"]
    square = (AT[:, :2] ** 2).sum(axis=1)
    assert found == pytest.approx(np.stack([AT[:, 1] / square, -AT[:, 0] / square], axis=1), rel=1e-14, abs=0)


def test_what_does_not_depend_on_a_number_costs_nothing(traced):
    (x, y, z), _ = traced
    assert tangents([x * y, z, 2.0], {x: 1.0}) == [y, 0.0, 0.0]
    assert adjoints([(x * y, 1.0), (3.0, z)], [x, z]) == [y, 0.0]
    assert tangents([x * 2.0 + y], {x: 1.0}) == [2.0]


def test_numbers_made_of_known_ones_follow_them(traced):
    (x, y, _), _ = traced
    product = x * y
    assert tangents([product, 2.0 * product, x], {product: 1.0}) == [1.0, 2.0, 0.0]


def test_substitutes_fold(traced):
    inputs, outputs = traced
    x, y, z = inputs
    assert substitute([x * y + z, x, 1.0], {x: 0.0}) == [z, 0.0, 1.0]
    assert substitute(outputs, {}) == outputs
    floats = substitute(outputs, dict(zip(inputs, AT[0].tolist(), strict=True)))
    assert floats == pytest.approx([float(a) for a in expression(*AT[0])], rel=1e-15, abs=0)
    arrays = substitute(outputs, dict(zip(inputs, AT.T, strict=True)))
    assert np.stack(arrays, axis=1) == pytest.approx(values(inputs, outputs), rel=1e-15, abs=0)


def test_the_larger_of_two_numbers_has_no_derivative(traced):
    (x, y, _), _ = traced
    for derivatives in (lambda z: tangents([z], {x: 1.0}), lambda z: adjoints([(z, 1.0)], [x])):
        with pytest.raises(NotTraceableError, match="'max' has no derivative"):
            derivatives(apply("max", x, y) * x)


def test_a_trace_may_be_larger_or_smaller_than_usual():
    trace = Trace(most=3)
    x = trace.input(np.ones(1))
    square = x * x
    with pytest.raises(NotTraceableError, match="more than 3 operations"):
        _ = apply("sin", square) + x


def test_a_function_is_zero_where_inputs_are_left_out():
    trace = Trace()
    x, y = ([trace.input(np.ones(1)) for _ in range(2)] for _ in range(2))
    function = Function({"x": x, "y": y}, {"sum": [x[0] + y[1], 7.0], "x": [x[1]], "none": []})
    assert isinstance(x[0], Node)
    assert function.operations == 1
    for n in (2, 3, 2):
        found = function(n, x=np.array([1.0, 2.0]))
        assert {name: array.tolist() for name, array in found.items()} == {
            "sum": [[1.0, 7.0]] * n,
            "x": [[2.0]] * n,
            "none": [[]] * n,
        }
    both = function(2, x=np.ones((2, 2)), y=np.array([[0.0, 1.0], [0.0, 2.0]]))
    assert both["sum"][:, 0].tolist() == [2.0, 3.0]
