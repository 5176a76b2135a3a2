"""Random mechanisms as a strategy of Hypothesis."""

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

import screwgauge
from screwgauge.families.draw import families

#: A few examples, the same every time.
FEW = settings(max_examples=5, derandomize=True, database=None, deadline=None)


def scenes(*only: str) -> SearchStrategy[screwgauge.Scene]:
    return st.builds(screwgauge.random, st.integers(0, 999), st.sampled_from(only or families()))
