"""ARX models of high order: the reference for the grey box (paper, section 4), and a source of starting values.

    y(t) + a_1 y(t-1) + .. + a_n y(t-n) = b_1 u(t-1) + .. + b_n u(t-n) + c + e(t)

c is an offset of each record.  Least squares over the rows without missing values (Ljung, System Identification, 2nd
ed., 4.2 and 7.3).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike

from monitor_core.arrays import Complexes, Floats
from monitor_core.identification.black_boxes.frequency_response import (
    FrequencyResponse,
    by_gradient,
    on_circle,
)
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.records.uniform_grid import Regular, on_grid, stretches

_LARGEST = 200
"""Default of the largest order that is compared by AIC."""


@dataclass(frozen=True, eq=False)
class Arx:
    """An ARX model of order n."""

    interval_s: float
    a: Floats  # (n,) a_1 .. a_n
    b: Floats  # (n,) b_1 .. b_n
    offset: Floats  # (records,) c, in units of y
    root: Floats  # (2 n, r) with lam0 root root' the covariance of (a, b), of rank r
    lam0: float  # variance of e
    rows: int  # equations behind it

    def response(self, frequency_hz: ArrayLike, name: str = "") -> FrequencyResponse:
        """G = B / A with its variance by the delta method:  dG/da_i = -z^-i G / A,  dG/db_i = z^-i / A."""
        f, z = on_circle(frequency_hz, self.interval_s)
        past: Complexes = z[:, None] ** -np.arange(1.0, self.a.size + 1)
        A = 1 + past @ self.a
        G: Complexes = (past @ self.b) / A
        dG: Complexes = np.hstack([-past * G[:, None], past]) / A[:, None]
        return by_gradient(f, G, dG, np.sqrt(self.lam0) * self.root, name or f"ARX, order {self.a.size}")


def fit_arx(
    records: Sequence[Record] | Sequence[Regular],
    order: int | None = None,
    *,
    largest: int | None = None,
) -> Arx:
    """The ARX model of one or several records.

    Args:
        records: with one interval; where a sample is missing, the rows that need it are left out.
        order: n; None: that of least AIC.
        largest: order up to which AIC is computed; default 200 or a tenth of the samples.

    Raises:
        ValueError: irregular samples, or fewer rows than parameters.
    """
    series = on_grid(records)
    known = sum(int(record.known.sum()) for record in series)
    n = (largest or max(1, min(_LARGEST, known // 10))) if order is None else order
    R, rows = _factor(series, n)
    p = R.shape[1] - 1
    if rows <= p + 1:
        raise ValueError(
            f"{rows} rows without a missing sample for {p} parameters of an ARX model of order {n}: a longer record,"
            " fewer gaps or a lower order is needed"
        )
    if order is None and (best := least_order(R, rows, len(series))) < n:
        return fit_arx(series, best)
    theta, root = _solve(R, p)
    rss = float(np.sum((R[:, -1] - R[:, :p] @ theta) ** 2))
    offset, ab = theta[: len(series)], theta[len(series) :]
    root_a, root_b = -root[len(series) :: 2], root[len(series) + 1 :: 2]
    root_ab, lam0 = np.vstack([root_a, root_b]), rss / (rows - root.shape[1])
    return Arx(series[0].interval_s, -ab[::2], ab[1::2], offset, root_ab, lam0, rows)


# --- Least squares over many rows: the triangular factor of all rows, a few thousand of them at a time ----------------


_HIDDEN = 1e-12
"""Singular values below this share of the largest count as zero (columns are scaled to length one)."""
_AT_ONCE = 4096
"""Number of rows that are processed at once."""


def _factor(series: Sequence[Regular], n: int) -> tuple[Floats, int]:
    """R (p + 1, p + 1), upper triangular, with R' R the Gram matrix of all rows without missing values; their number.

    Columns: the constants of the records, y(t-1), u(t-1), y(t-2), .. , y(t), so that the factors of all lower orders
    are parts of R.
    """
    width, count = len(series) + 2 * n + 1, 0
    R = np.zeros((width, width))
    for k, record in enumerate(series):
        z = np.column_stack([record.y, record.u]).ravel()
        for a, b in stretches(record.known):
            if b - a <= n:
                continue
            # y(t-n), u(t-n), .. , y(t-1), u(t-1), y(t)
            past = sliding_window_view(z[2 * a : 2 * b - 1], 2 * n + 1)[::2]
            count += len(past)
            for first in range(0, len(past), _AT_ONCE):
                part = past[first : first + _AT_ONCE]
                rows = np.zeros((len(part), width))
                rows[:, k] = 1.0
                rows[:, len(series) : -1 : 2] = part[:, -3::-2]
                rows[:, len(series) + 1 : -1 : 2] = part[:, -2::-2]
                rows[:, -1] = part[:, -1]
                R = np.asarray(np.linalg.qr(np.vstack([R, rows]), mode="r"))
    return R, count


def _solve(R: Floats, p: int) -> tuple[Floats, Floats]:
    """Least squares of the last column of R on the first p: theta (p,) of least norm, and root (p, r) of rank r.

    root root' = (Phi' Phi)^+
    """
    scale = np.linalg.norm(R[:p, :p], axis=0)
    scale[scale == 0] = 1.0
    T = R[:p, :p] / scale
    U, s, Vt = np.linalg.svd(T)
    seen = s > _HIDDEN * s.max(initial=0.0)
    root = (Vt[seen].T / s[seen]) / scale[:, None]
    return root @ (U[:, seen].T @ R[:p, -1]), root


def least_order(R: Floats, N: int, before: int) -> int:
    """The order n of least  N log(RSS / N) + 2 p  (Akaike), RSS of every order read off the last column of R (c, c).

    Its columns are those ``before``, which every order has, two for each order, and the right-hand side; N rows.
    """
    below = np.cumsum(R[::-1, -1] ** 2)[::-1]
    orders = np.arange(1, (R.shape[0] - 1 - before) // 2 + 1)
    p = 2 * orders + before
    # A record without noise: the residual is rounding, and more parameters would fit only that.
    rss = np.maximum(below[p], 1e-20 * below[0])
    return int(orders[np.argmin(N * np.log(rss / N) + p * 2.0)])
