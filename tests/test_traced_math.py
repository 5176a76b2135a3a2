import numpy as np
import pytest

from support.traced import Trace, apply, program

pytest.importorskip("llvmlite", reason="llvmlite is not installed")

#: Units in the last place of the result, or of a result of 1e-3 where it is smaller.
ULPS = 2.0


def native(name, *inputs):
    from support.traced import Native, machine_code

    trace = Trace()
    nodes = [trace.input(np.zeros(1)) for _ in inputs]
    made = program(len(nodes), [apply(name, *nodes)])
    out = np.empty((1, len(inputs[0])))
    Native(made, machine_code(made)).bind([np.array(inputs)], [out])()
    return out[0]


def ulps(found, expected):
    return np.abs(found - expected) / np.spacing(np.maximum(np.abs(expected), 1e-3))


@pytest.fixture(scope="module")
def angles():
    rng = np.random.default_rng(0)
    spread = np.concatenate([rng.uniform(-(10.0**k), 10.0**k, 2000) for k in range(-6, 7)])
    quarters = np.arange(-636000, 636000, 997) * (np.pi / 2)  # next to their zeros
    return np.concatenate([spread, quarters, [0.0, -0.0, 1e6, -1e6]])


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_sine_and_cosine_up_to_a_million_rad(name, angles):
    angles = angles[np.abs(angles) <= 1e6]
    expected = getattr(np, name)(angles.astype(np.longdouble)).astype(float)
    assert ulps(native(name, angles), expected).max() <= ULPS


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_beyond_that_they_are_no_numbers(name):
    assert np.isnan(native(name, np.array([1.001e6, -3e7, np.inf, np.nan]))).all()


def test_angles_of_vectors_in_all_directions():
    rng = np.random.default_rng(1)
    turn, size = rng.uniform(-np.pi, np.pi, 20000), 10.0 ** rng.uniform(-8, 8, 20000)
    y, x = size * np.sin(turn), size * np.cos(turn)
    y, x = (np.concatenate([v, w]) for v, w in ((y, [0.0, 0.0, 1.0, -1.0, 0.0]), (x, [1.0, -1.0, 0.0, 0.0, 2.0])))
    assert ulps(native("atan2", y, x), np.arctan2(y, x)).max() <= ULPS
