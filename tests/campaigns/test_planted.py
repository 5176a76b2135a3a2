"""Planted mistakes: `check --smoke` sees nearly all of them, and a test sees each of the rest."""

import pytest
from planted import FILES, mistakes, seen

#: Of thirty in what computes, and of ten in what reads and diagnoses.
LEAST, LEAST_OF_FILES = 27, 7


@pytest.mark.campaign
def test_check_smoke_sees_planted_mistakes():
    by_smoke, unseen = {True: 0, False: 0}, []
    for mistake, who in seen(mistakes(), tests=True):
        print(f"{mistake.room}\t{mistake.about}\t{who or 'NOT SEEN'}", flush=True)
        by_smoke[mistake.room == FILES] += bool(who) and who != f"seen by {mistake.test}"
        if not who:
            unseen.append(mistake.about)
    assert unseen == []
    assert by_smoke[False] >= LEAST
    assert by_smoke[True] >= LEAST_OF_FILES
