import numpy as np
import pytest

from support.errors import SingularPoseError
from support.tolerances import PLACED
from support.trees import project


class Line:
    """One closing row, ``q = 0``."""

    def place(self, q: np.ndarray, v: np.ndarray) -> None:
        self.q = q

    def closure(self) -> tuple[np.ndarray, np.ndarray]:
        return self.q[:1].copy(), np.array([[1.0, 0.0]])


def test_a_drifted_state_comes_back():
    q, v, _ = project(Line(), np.array([1e-6, 2.0]), np.array([1e-3, 3.0]))
    assert np.allclose(q, [0.0, 2.0], atol=PLACED)
    assert np.allclose(v, [0.0, 3.0], atol=PLACED)


@pytest.mark.parametrize(
    ("q", "v"), [([np.inf, 0.0], [0.0, 0.0]), ([np.nan, 0.0], [0.0, 0.0]), ([0.0, 0.0], [np.inf, 0.0])]
)
def test_a_state_without_bounds_is_refused(q, v):
    with pytest.raises(SingularPoseError, match="smaller steps"):
        project(Line(), np.array(q), np.array(v))
