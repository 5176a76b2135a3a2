"""How much the closing system amplifies rounding, loop by loop."""

from __future__ import annotations

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.closed.loops import LoopEquations
from screwgauge.reference.extent import extent
from screwgauge.reference.rotations import Array


def gain(system: LoopEquations, A: Array) -> tuple[Array, Array]:
    """Condition number of a matrix of `LoopEquations.matrix`, and the norm of its inverse over its worst loop.

    For the second, rows and unknowns count in the length of their own loop. Shape (n, m, n_unknown) -> (n,), (n,).
    """
    found, unknown, (owner, force, *_) = extent(system.lay), system.unknown, system.kinds
    mechanism = system.lay.mechanism
    chosen = [*mechanism.coupling_rows.columns, *mechanism.independent_columns]
    rows = np.concatenate(
        [np.where(force, system.length / found.loops[owner], 1.0), system.size[chosen] / found.size[chosen]]
    )
    inverse, condition = linear.inverted(A)
    squares = np.einsum("nij,j->ni", inverse * inverse, rows**-2.0)
    squares *= (system.size[unknown] / found.size[unknown]) ** 2
    loops = found.owner[unknown][:, None] == np.arange(max(len(found.loops), 1))
    worst = np.sqrt((squares @ loops).max(axis=1))
    return condition, np.where(np.isfinite(condition), worst, condition)
