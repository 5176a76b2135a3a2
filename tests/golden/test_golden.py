"""Numbers and words are those that were kept; ``python tests/golden/make.py`` keeps others."""

import numpy as np
import pytest
from golden.facts import differences, read
from golden.kept import PARTS

TABLES = {part: read(part) for part in PARTS}


def marks(part: str, i: int, case: str) -> list[pytest.MarkDecorator]:
    """When a case is looked at."""
    if PARTS[part].long(case):
        return [pytest.mark.thorough]
    return [] if PARTS[part].quick(i, case) else [pytest.mark.slow]


CASES = [
    pytest.param(part, case, marks=marks(part, i, case))
    for part, cases in TABLES.items()
    for i, case in enumerate(cases)
]


@pytest.mark.parametrize(("part", "case"), CASES)
def test_nothing_has_changed(part, case):
    with np.errstate(all="ignore"):
        now = PARTS[part].facts(case)
    assert differences(now, TABLES[part][case]) == []
