import numpy as np
import pytest

from screwgauge.plugins import Branch, ClosureError, GivenMotion
from support.mechanism import load_mechanism
from support.tolerances import CLOSED

MECHANISM = load_mechanism("slider-crank")


def loop(R, L, redundant=False):
    """Gap of crank R and rod L: angles, across, along the slide."""

    def gaps(q):
        (crank, pin, wrist, slide), one, zero = q.T, np.ones(len(q)), np.zeros(len(q))
        open_by = [
            crank + pin + wrist,
            R * np.sin(crank) - L * np.sin(wrist),
            slide - R * np.cos(crank) - L * np.cos(wrist),
        ]
        rows = [
            [one, one, one, zero],
            [R * np.cos(crank), zero, -L * np.cos(wrist), zero],
            [R * np.sin(crank), zero, L * np.sin(wrist), one],
        ]
        if redundant:  # the same once more, as the sum of two
            open_by, rows = [*open_by, open_by[1] + open_by[2]], [*rows, np.add(rows[1], rows[2])]
        return np.stack(open_by, axis=1), np.moveaxis(np.array(rows), 2, 0)

    return gaps, [True, False, False, False][: 3 + redundant]


def closed(crank, R, L):
    wrist = np.arcsin(R / L * np.sin(crank))
    return np.stack([crank, -crank - wrist, wrist, R * np.cos(crank) + L * np.cos(wrist)], axis=1)


def motion(crank, drive=None):
    y = crank[:, None]
    return GivenMotion(np.arange(len(y), dtype=float), y, 0.0 * y, 0.0 * y, drive)


@pytest.mark.parametrize("redundant", [False, True])
@pytest.mark.parametrize("n", [7, 400])
def test_turns_are_counted_however_far_samples_are_apart(n, redundant):
    crank = np.linspace(0.3, 8.0 * np.pi, n)
    q = Branch(MECHANISM, *loop(0.1, 0.3, redundant)).follow(motion(crank))
    assert np.abs(q - closed(crank, 0.1, 0.3)).max() < CLOSED * np.abs(q).max()


def test_a_motion_goes_on_where_the_part_before_ended():
    crank = np.linspace(0.0, 9.0, 40)
    branch = Branch(MECHANISM, *loop(0.1, 0.3))
    parts = [branch.follow(motion(crank[:25])), branch.follow(motion(crank[25:]))]
    assert np.abs(np.concatenate(parts) - closed(crank, 0.1, 0.3)).max() < CLOSED * 10.0


def test_what_solves_the_system_says_how_coordinates_follow_y():
    branch, crank, h = Branch(MECHANISM, *loop(0.1, 0.3)), np.array([0.7]), 1e-6
    q = branch.follow(motion(crank))
    inverse, condition, missed = branch.system(q, crank[:, None] + 0.1)
    slope = (closed(crank + h, 0.1, 0.3) - closed(crank - h, 0.1, 0.3)) / (2.0 * h)
    assert inverse[..., -1] == pytest.approx(slope, abs=1e-9)
    assert 1.0 < condition[0] < 100.0
    assert missed[0] == pytest.approx([0.0, 0.0, 0.0, -0.1], abs=CLOSED)


@pytest.mark.parametrize("end", [1.2, 2.5])
def test_a_rod_that_is_too_short_ends_the_branch_where_it_does(end):
    """A crank longer than its rod turns up to asin(L / R); the loop closes again beyond pi minus that."""
    branch = Branch(MECHANISM, *loop(0.4, 0.3))
    with pytest.raises(ClosureError, match=r"t = 1 s|t = 0\.\d+ s") as error:
        branch.follow(motion(np.array([0.0, end])))
    reached = float(str(error.value).partition("[")[2].partition("]")[0])
    assert reached == pytest.approx(np.arcsin(0.75), abs=1e-3)


def test_between_samples_the_motion_itself_is_followed():
    """The straight way to the same sample would not pass the dead point."""
    branch, straight = (Branch(MECHANISM, *loop(0.4, 0.3)) for _ in range(2))
    ends = np.array([0.0, 0.8])
    assert len(straight.follow(motion(ends))) == 2
    with pytest.raises(ClosureError):
        branch.follow(motion(ends, lambda t: motion(0.8 * t + 4.0 * t * (1.0 - t))))
