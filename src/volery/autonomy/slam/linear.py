"""Small dense linear algebra, most of it inside kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.compiled import brief_kernel, inner_kernel


@inner_kernel
def _pivot(matrix: Array, j: int) -> int:
    """Returns the row from j on with the largest magnitude in column j."""
    found = j
    for i in range(j + 1, matrix.shape[0]):
        if abs(matrix[i, j]) > abs(matrix[found, j]):
            found = i
    return found


@inner_kernel
def _swap(matrix: Array, one: int, other: int) -> None:
    for k in range(matrix.shape[1]):
        matrix[one, k], matrix[other, k] = matrix[other, k], matrix[one, k]


@inner_kernel
def eliminate(matrix: Array, right: Array) -> bool:
    """Replaces `right` (n, m) by the solution of `matrix` (n, n) X = right; False: singular.

    It is Gaussian elimination with partial pivoting and overwrites `matrix`.
    """
    n, m = right.shape
    for j in range(n):
        pivot = _pivot(matrix, j)
        if not abs(matrix[pivot, j]) > 1e-14:
            return False
        _swap(matrix, j, pivot)
        _swap(right, j, pivot)
        for i in range(j + 1, n):
            factor = matrix[i, j] / matrix[j, j]
            for k in range(j, n):
                matrix[i, k] -= factor * matrix[j, k]
            for k in range(m):
                right[i, k] -= factor * right[j, k]
    for i in range(n - 1, -1, -1):
        for k in range(m):
            rest = right[i, k]
            for j in range(i + 1, n):
                rest -= matrix[i, j] * right[j, k]
            right[i, k] = rest / matrix[i, i]
    return True


@brief_kernel
def block(matrix: Array, rows: NDArray[np.int64]) -> Array:
    """Returns the submatrix (K, K) of rows and columns `rows` (K,)."""
    out = np.empty((len(rows), len(rows)))
    for i in range(len(rows)):
        for k in range(len(rows)):
            out[i, k] = matrix[rows[i], rows[k]]
    return out
