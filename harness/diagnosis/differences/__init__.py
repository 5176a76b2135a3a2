"""Differences: facts in which two models are unlike, a property of a part each, with the change that mends it."""
