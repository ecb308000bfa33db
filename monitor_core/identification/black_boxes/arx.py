"""ARX models of high order: the reference for the grey box (paper, section 4), and where starting values come from.

    y(t) + a_1 y(t-1) + .. + a_n y(t-n) = b_1 u(t-1) + .. + b_n u(t-n) + c + e(t)

c is an offset of each record.  Least squares over the rows without missing values (Ljung, System Identification, 2nd
ed., 4.2 and 7.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from monitor_core.arrays import Floats, Ints
from monitor_core.identification.black_boxes.frequency_response import (
    Complexes,
    FrequencyResponse,
    by_gradient,
    on_circle,
)
from monitor_core.identification.black_boxes.least_squares import (
    ONES,
    Criterion,
    Factor,
    Lags,
    factor,
    least_order,
    solve,
)
from monitor_core.identification.records.record import Record
from monitor_core.identification.records.uniform_grid import Regular, on_grid

_LARGEST = 200
"""Order up to which a criterion looks, unless told."""


@dataclass(frozen=True, eq=False)
class Arx:
    """An ARX model of order n."""

    interval_s: float
    a: Floats  # (n,) a_1 .. a_n
    b: Floats  # (n,) b_1 .. b_n
    offset: Floats  # (records,) c, in units of y
    root: (
        Floats  # (2 n, r) with lam0 root root' the covariance of (a, b); r: how many numbers the records tell
    )
    lam0: float  # variance of e
    rows: int  # equations behind it

    def response(self, frequency_hz: ArrayLike, name: str = "") -> FrequencyResponse:
        """G = B / A with its variance by the delta method:  dG/da_i = -z^-i G / A,  dG/db_i = z^-i / A.

        Raises:
            ValueError: a frequency beyond half the sampling frequency.
        """
        f, z = on_circle(frequency_hz, self.interval_s)
        past: Complexes = z[:, None] ** -np.arange(1.0, self.a.size + 1)
        A = 1 + past @ self.a
        G: Complexes = (past @ self.b) / A
        dG: Complexes = np.hstack([-past * G[:, None], past]) / A[:, None]
        return by_gradient(f, G, dG, np.sqrt(self.lam0) * self.root, name or f"ARX, order {self.a.size}")


def fit_arx(
    records: Sequence[Record] | Sequence[Regular],
    order: int | Criterion = "aic",
    *,
    largest: int | None = None,
) -> Arx:
    """The ARX model of one or several records.

    Args:
        records: with one interval; where a sample is missing, the rows that need it are left out.
        order: n, or the criterion that chooses it.
        largest: order up to which the criterion looks; default 200 or a tenth of the samples.

    Raises:
        ValueError: an order below 1, irregular samples, or fewer rows than parameters.
    """
    series = on_grid(records)
    known = sum(int(record.known.sum()) for record in series)
    n = order if isinstance(order, int) else largest or max(1, min(_LARGEST, known // 10))
    if n < 1:
        raise ValueError(f"order {n}: need 1 at least")
    constants = len(series)
    blocks = [Lags(0, 0, n), Lags(1, 1, n), *(Lags(ONES + k, 0, 0) for k in range(constants))]
    # c, y(t-1), u(t-1), y(t-2), .., y(t): then the factor contains those of all lower orders, too.
    pairs = [column for lag in range(1, n + 1) for column in (lag, n + lag)]
    columns = np.array([*range(2 * n + 1, 2 * n + 1 + constants), *pairs, 0], dtype=np.int64)
    found = factor(series, blocks, columns)
    if found.rows <= columns.size:
        raise ValueError(
            f"{found.rows} rows without a missing sample for {columns.size - 1} parameters of an ARX model of order"
            f" {n}: a longer record, fewer gaps or a lower order is needed"
        )
    if not isinstance(order, int) and (best := least_order(found.R, found.rows, constants, order)) < n:
        return fit_arx(series, best)
    return _model(found, columns, n, series[0].interval_s)


def _model(found: Factor, columns: Ints, n: int, interval_s: float) -> Arx:
    R, N = found
    p = R.shape[0] - 1
    theta, root = solve(R, p)
    rss = float(np.sum((R[:, -1] - R[:, :p] @ theta) ** 2))
    place = np.argsort(columns[:-1])
    theta, root = theta[place], root[place]
    root[:n] *= -1
    a, b, c = np.split(theta, [n, 2 * n])
    return Arx(interval_s, -a, b, c, root[: 2 * n], rss / (N - root.shape[1]), N)
