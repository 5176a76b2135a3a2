import numpy as np
import pytest

from support.mechanism import PolynomialSum
from support.tolerances import FORMULA

F = PolynomialSum(0.3, {"a": np.array([2.0, -1.5, 0.4]), "b": np.array([-0.7]), "c": np.array([0.0, 0.5])})
Q = {"a": 0.6, "b": -1.2, "c": 0.9}
VALUE = 0.3 + (2.0 * 0.6 - 1.5 * 0.6**2 + 0.4 * 0.6**3) + 0.7 * 1.2 + 0.5 * 0.9**2


def near(value: float):
    return pytest.approx(value, rel=FORMULA, abs=0)


def test_it_is_the_sum_and_constants_add_up():
    assert F(Q) == near(VALUE)
    parts = {"a": np.array([0.1, 2.0, -1.5, 0.4]), "b": np.array([0.2, -0.7]), "c": np.array([0.0, 0.0, 0.5])}
    assert PolynomialSum.of(parts)(Q) == near(VALUE)
    assert PolynomialSum.of(F.polynomials).equals(F)
    assert PolynomialSum.of({"": np.array([0.4])}).terms == {}


def test_coordinates_may_count_from_elsewhere_and_the_other_way():
    zeros, factors = {"a": 0.25, "c": -0.5}, {"a": -1.0, "b": 2.0}
    counted = {name: (q - zeros.get(name, 0.0)) / factors.get(name, 1.0) for name, q in Q.items()}
    assert F.change_variables(zeros, factors)(counted) == near(VALUE)
    assert F.rename({"a": "x"})({**Q, "x": Q["a"]}) == near(VALUE)


def test_coordinates_that_rest_are_constants():
    held = F.at({"a": Q["a"], "c": Q["c"]})
    assert list(held.terms) == ["b"]
    assert held(Q) == near(VALUE)


def test_it_can_be_solved_for_what_it_is_linear_in():
    assert [F.is_linear_in(name) for name in ("a", "b", "c", "d")] == [False, True, False, False]
    assert F.solve("q", "b")({"q": VALUE, **Q}) == near(Q["b"])
    assert (F.linear, F.at(Q).linear) == (False, True)


def test_differences_and_multiples():
    other = PolynomialSum(0.1, {"c": np.array([1.0]), "d": np.array([3.0])})
    assert F.minus(other)({**Q, "d": 0.2}) == near(VALUE - 0.1 - 0.9 - 0.6)
    assert F.times(-2.0).plus(1.0)(Q) == near(1.0 - 2.0 * VALUE)
    assert not F.equals(other)
    ours, theirs = F.paired_coefficients(F.times(2.0))
    assert theirs == pytest.approx(2.0 * ours, rel=0, abs=0)
    assert F.fill(theirs).trimmed(Q) == near(2.0 * VALUE)
