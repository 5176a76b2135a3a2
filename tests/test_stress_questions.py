"""Pickled questions."""

from __future__ import annotations

import pickle
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from support.questions import findings
from support.stress import CASES

pytestmark = pytest.mark.slow


@pytest.mark.slow
@pytest.mark.parametrize("name", ["upu-singularity", "closure-violation", "refinement", "proximal", "long-run"])
def test_a_copy_is_answered_to_the_last_bit(name: str, tmp_path: Path) -> None:
    case = CASES[name]
    with np.errstate(all="ignore"):
        for question in case.ask(case.quick[0], True, tmp_path):
            for one, other in zip(findings(question), findings(pickle.loads(pickle.dumps(question))), strict=True):
                np.testing.assert_equal(asdict(replace(other, time_s=0.0)), asdict(replace(one, time_s=0.0)))
