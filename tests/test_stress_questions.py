"""Every question of every quick ladder is data: it pickles, and its copy is answered to the last bit."""

from __future__ import annotations

import pickle
from dataclasses import asdict, fields, replace
from pathlib import Path

import numpy as np
import pytest

from screwgauge.study.cases.question import Question, findings
from screwgauge.study.cases.registry import CASES


def copied(question: Question) -> Question:
    return pickle.loads(pickle.dumps(question))


@pytest.mark.parametrize("name", CASES)
def test_questions_at_both_ends_of_a_quick_ladder_pickle(name: str, tmp_path: Path) -> None:
    case = pickle.loads(pickle.dumps(CASES[name]))
    assert case.name == name
    last = case.quick[1 if case.whole else -1]  # more loops or samples are more of the same
    for i, severity in enumerate((case.quick[0], last)):
        folder = tmp_path / str(i)
        folder.mkdir()
        with np.errstate(all="ignore"):
            questions = list(case.ask(severity, True, folder))
        assert questions
        for question in questions:
            copy = copied(question)
            assert [method.name for method in copy.methods] == [method.name for method in question.methods]
            assert copy.problem.wanted == question.problem.wanted
            assert copy.known == question.known
            for field in fields(question.problem.task):
                one, other = (getattr(each.problem.task, field.name) for each in (question, copy))
                np.testing.assert_equal(other, one)


@pytest.mark.parametrize("name", ["upu-singularity", "closure-violation", "refinement", "proximal", "long-run"])
def test_a_copy_is_answered_to_the_last_bit(name: str, tmp_path: Path) -> None:
    case = CASES[name]
    with np.errstate(all="ignore"):
        for question in case.ask(case.quick[0], True, tmp_path):
            for one, other in zip(findings(question), findings(copied(question)), strict=True):
                np.testing.assert_equal(asdict(replace(other, time_s=0.0)), asdict(replace(one, time_s=0.0)))
