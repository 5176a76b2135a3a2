import numpy as np
import pytest

from support.errors import ModelFileError
from support.mechanism import load_mechanism, mechanism_names
from support.models import loops_of, read_loops, write_loops


@pytest.mark.slow
@pytest.mark.parametrize("cut", ["minimal", "full"])
@pytest.mark.parametrize("name", mechanism_names())
def test_round_trip(name: str, cut: str, write) -> None:
    mechanism = load_mechanism(name)
    want = loops_of(mechanism, cut)
    have = read_loops(write("a.loops.toml", write_loops(mechanism, cut)))
    for key in ("mechanism", "cut", "bodies", "tree", "independent"):
        assert getattr(have, key) == getattr(want, key)
    for first, second in zip(want.joints, have.joints, strict=True):
        for key in ("name", "kind", "parent", "child", "coordinates", "actuated"):
            assert getattr(first, key) == getattr(second, key)
        for key in ("home", "limits", "axes"):
            np.testing.assert_array_equal(getattr(second, key), getattr(first, key))
    for first, second in zip((*want.joints, *want.closures), (*have.joints, *have.closures), strict=True):
        for side in ("parent_frame", "child_frame"):
            np.testing.assert_array_equal(getattr(second, side).p, getattr(first, side).p)
            np.testing.assert_array_equal(getattr(second, side).R, getattr(first, side).R)
    for first, second in zip(want.closures, have.closures, strict=True):
        assert (first.joint, first.type, first.parent, first.child) == (
            second.joint,
            second.type,
            second.parent,
            second.child,
        )
        np.testing.assert_array_equal(second.parent_points, first.parent_points)
        np.testing.assert_array_equal(second.child_points, first.child_points)
    assert (have.axial is None) == (want.axial is None) == (mechanism.axial is None)
    if have.axial is None or want.axial is None:
        return
    assert have.axial[0] == want.axial[0]
    np.testing.assert_array_equal(have.axial[1], want.axial[1])


def test_a_missing_file_is_named(tmp_path) -> None:
    with pytest.raises(ModelFileError, match=r"nowhere\.toml: .*; check the path"):
        read_loops(tmp_path / "nowhere.toml")
