import re

import numpy as np
import pytest

import screwgauge
from screwgauge.report.stage.machines import machines
from support.data import data
from support.mechanism import load_mechanism
from support.models import write_models

BAR = data("four-bar-of-mass.toml")


@pytest.mark.slow
@pytest.mark.parametrize(("a", "b"), [("urdf", "urdf"), ("urdf", "xml"), ("xml", "urdf")])
def test_lines_of_a_loop_end_where_others_begin(a, b, write, tmp_path):
    for name, mass in (("one", "0.5"), ("two", "0.6")):
        write_models(load_mechanism(write("bar.toml", BAR.replace("MASS", mass))), tmp_path / name)
    diagnosis = screwgauge.diagnose(tmp_path / f"one/bar.{a}", tmp_path / f"two/bar.{b}")
    lines = re.findall(
        r'<path(?: class="differs")? d="M([\d.-]+),([\d.-]+)L([\d.-]+),([\d.-]+)"/>', machines(diagnosis).svg
    )
    for side in (0.0, 290.0):
        ends = [line for line in {*lines} if side < float(line[0]) < side + 290.0 and line[:2] != line[2:]]
        points = np.array(ends, dtype=float).reshape(-1, 2)
        apart = np.hypot(*(points[:, None] - points).T)
        assert len(points) == 8  # of four lines
        assert ((apart < 0.3).sum(axis=1) == 2).all()
        assert min(np.ptp(points, axis=0)) > 20.0  # and not flat
