"""Named bounds of the tests, with the reason beside each. What is relative is so to the largest value compared."""

from __future__ import annotations

#: Two routes through the same linear equations, a few hundred operations apart.
LINEAR = 1e-12
