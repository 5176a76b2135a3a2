"""Linear algebra on stacks of small matrices: solution, inverse, condition number, null space."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array

EPS = float(np.finfo(float).eps)
#: Condition number above which a matrix counts as singular: fewer than four digits would remain.
SINGULAR = 1e12
#: Rounding error of one closing equation or joint axis in units of eps, accumulated over a few hundred operations.
ROUNDED = 2.0
#: Interval between matrices along a motion that are inverted directly; number of matrices processed at a time.
EVERY, BLOCK = 16, 128
#: Relative error above which no digit is correct.
DIGIT = 0.1


def solve(A: Array, b: Array) -> Array:
    """Solve ``A x = b`` for a stack of square, or consistent tall or wide, matrices.

    Regular square stacks are solved by LU, tall stacks with full rank by QR (least squares), and all others by the
    pseudo-inverse (least squares, minimum norm).

    Args:
        A: Shape (..., m, n).
        b: Shape (..., m, k).

    Returns:
        Shape (..., n, k). NaN stays NaN.
    """
    if A.shape[-1] == A.shape[-2]:
        with suppress(np.linalg.LinAlgError):  # raised if one matrix is exactly singular
            return np.asarray(np.linalg.solve(A, b))
    if A.shape[-2] > A.shape[-1] > 0:
        Q, R = np.linalg.qr(A)
        pivots = np.abs(np.diagonal(R, axis1=-2, axis2=-1))
        # full rank is certain: the result equals the pseudo-inverse's, in a fifth of the time
        if (pivots.min(axis=-1) > 1e-7 * pivots.max(axis=-1)).all():
            return np.asarray(np.linalg.solve(R, Q.swapaxes(-1, -2) @ b))
    finite = np.isfinite(A).all(axis=(-1, -2), keepdims=True)
    rcond = max(1e-13, 450.0 * float(np.finfo(A.dtype).eps))  # float32 cannot resolve 1e-13
    return np.where(finite, np.linalg.pinv(np.where(finite, A, 0.0), rcond=rcond) @ b, np.nan)


def condition(A: Array) -> Array:
    """Return the condition number in the Frobenius norm, or inf for singular matrices. Shape (..., m, n) -> (...).

    It is at most n times the 2-norm condition number, and an order of magnitude faster to compute along a trajectory.
    """
    size = norms(A)
    if A.shape[-2] > A.shape[-1]:  # the triangular factor has the same singular values
        A = np.asarray(np.linalg.qr(A, mode="r"))
    if A.shape[-1] != A.shape[-2]:
        s = np.linalg.svd(A, compute_uv=False)
        with np.errstate(divide="ignore"):
            return np.asarray(size * np.sqrt(np.sum(s**-2.0, axis=-1)))
    number = size * norms(inverse(A))
    return np.asarray(np.where(np.isnan(number) & np.isfinite(size), np.inf, number))


def invert(A: Array) -> tuple[Array, Array]:
    """Compute the inverse, in the sense of `solve`, and the condition number. (..., m, n) -> (..., n, m), (...)."""
    if A.shape[-2] > A.shape[-1] > 0:
        Q, R = np.linalg.qr(A)
        back = inverse(R)
        number = norms(A) * norms(back)
        if (number < 1e7).all():
            return back @ Q.swapaxes(-1, -2), number
    if A.shape[-1] == A.shape[-2]:
        with suppress(np.linalg.LinAlgError):
            back = np.asarray(np.linalg.inv(A))
            return back, norms(A) * norms(back)
    return solve(A, np.eye(A.shape[-2])), condition(A)


def invert_along(A: Array) -> tuple[Array, Array]:
    """Invert slowly varying square matrices, shape (n, m, m); also return condition numbers.

    One in every `EVERY` matrices is inverted directly; all other inverses follow from Schulz's iteration
    ``X + X E + X E^2`` with ``E = 1 - A X``, in blocks of cache size. If the iteration fails, `invert` is used.
    """
    X, eye = np.empty_like(A), np.eye(A.shape[-1])
    if A.shape[1] != A.shape[2]:
        return invert(A)
    for rows in blocks(len(A)):
        some, x, error = A[rows], X[rows], 1.0
        middle = np.minimum(np.arange(EVERY // 2, len(some) + EVERY // 2, EVERY), len(some) - 1)
        x[:] = inverse(some[middle]).repeat(EVERY, axis=0)[: len(some)]
        E, more = np.empty_like(x), np.empty_like(x)
        while error > 1e-6:  # a step reduces E to its cube
            np.subtract(eye, np.matmul(some, x, out=E), out=E)
            before, error = error, max(E.max(), -E.min())
            if not error < 0.1 * before:
                return invert(A)
            x += np.matmul(x, E, out=more)
            if error > 1e-8:
                x += more @ E
    return X, norms(A) * norms(X)


def blocks(n: int) -> Iterator[slice]:
    """Yield blocks of rows that are small enough for their results to stay in the cache."""
    return (slice(i, i + BLOCK) for i in range(0, n, BLOCK))


def norms(A: Array) -> Array:
    """Compute Frobenius norms faster than `numpy.linalg.norm` for small matrices. Shape (..., m, n) -> (...)."""
    return np.asarray(np.sqrt(np.einsum("...ij,...ij->...", A, A)))


def inverse(A: Array) -> Array:
    """Invert a stack of square matrices; return NaN for exactly singular matrices. Shape (..., n, n)."""
    try:
        return np.asarray(np.linalg.inv(A))
    except np.linalg.LinAlgError:
        regular = np.linalg.slogdet(A)[0] != 0.0
        safe = np.where(regular[..., None, None], A, np.eye(A.shape[-1]))
        return np.where(regular[..., None, None], np.linalg.inv(safe), np.nan)


def null_space(A: Array, tolerance: float = 1e-9) -> Array:
    """Return an orthonormal basis of the null space of a dimensionless matrix, see `rank`. Shape (m, n) -> (n, k)."""
    _, s, Vt = np.linalg.svd(A)
    return np.asarray(Vt[_count(s, tolerance) :].T)


def rank(A: Array, tolerance: float = 1e-9) -> int:
    """Return the rank of a dimensionless matrix.

    Singular values up to `tolerance` times the largest singular value, or times 1 if that is larger, count as zero.
    """
    return _count(np.linalg.svd(A, compute_uv=False), tolerance)


def _count(s: NDArray[np.floating], tolerance: float = 1e-9) -> int:
    """Count the singular values above the tolerance, see `rank`."""
    return int(np.sum(s > tolerance * s.max(initial=1.0)))
