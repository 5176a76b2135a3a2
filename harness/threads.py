"""Fixes the number of threads to one. Imports nothing: BLAS reads the variables when numpy is first imported."""

from __future__ import annotations

import os
import sys

ONE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"), "1")


def fix_threads() -> bool:
    """One thread for BLAS and OpenMP.

    Returns:
        Whether it takes effect: False if numpy is there already, with whatever it was started with.
    """
    if "numpy" in sys.modules:
        return one_thread()
    os.environ.update(ONE)
    return True


def one_thread() -> bool:
    """Whether every variable is set to one thread."""
    return ONE.items() <= os.environ.items()
