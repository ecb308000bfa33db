"""ARX models of high order: the reference for grey and black boxes (paper, section 4).

    y(t) + a_1 y(t-1) + .. + a_na y(t-na) = b_1 u(t-k) + .. + b_nb u(t-k-nb+1) + c + e(t)

k is the delay: 1 by the hold, since u(t) acts from t on; 0 with a direct term.  c is an offset of each record.  Least
squares over the rows without missing values (Ljung, System Identification, 2nd ed., 4.2 and 7.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from monitor_core.arrays import Floats, Ints
from monitor_core.identification.frequency import Complexes, FrequencyResponse, by_gradient, on_circle
from monitor_core.identification.least_squares import (
    ONES,
    Criterion,
    Factor,
    Lags,
    factor,
    least_order,
    solve,
)
from monitor_core.identification.record import Record
from monitor_core.identification.uniform_grid import Regular, on_grid

_LARGEST = 200
"""Order up to which a criterion looks, unless told."""


@dataclass(frozen=True, eq=False)
class Arx:
    """An ARX model.

    Args:
        interval_s: s.
        a: (na,) a_1 .. a_na.
        b: (nb,) b_1 .. b_nb.
        delay: k, samples.
        offset: (records,) c, in units of y; zeros if it was not estimated.
        root: (na + nb, r) with lam0 root root' the covariance of (a, b).
        lam0: variance of e.
        rows: equations behind it.
        words: what should be known of it.
    """

    interval_s: float
    a: Floats
    b: Floats
    delay: int
    offset: Floats
    root: Floats
    lam0: float
    rows: int
    words: tuple[str, ...] = ()

    @property
    def covariance(self) -> Floats:
        """Of (a, b)."""
        return np.asarray(self.lam0 * self.root @ self.root.T)

    @cached_property
    def poles(self) -> Complexes:
        """(na,) in z, the largest first."""
        p = np.roots(np.concatenate([[1.0], self.a])).astype(np.complex128)
        return p[np.argsort(-np.abs(p))]

    @property
    def stable(self) -> bool:
        """All poles are inside the unit circle, so it can be simulated.  The predictor is stable in any case."""
        return bool(np.abs(self.poles).max(initial=0.0) < 1)

    def response(self, frequency_hz: ArrayLike, name: str = "") -> FrequencyResponse:
        """G = B / A with its variance by the delta method:  dG/da_i = -z^-i G / A,  dG/db_i = z^(1-i-k) / A.

        Raises:
            ValueError: a frequency beyond half the sampling frequency.
        """
        f, z = on_circle(frequency_hz, self.interval_s)
        past = _powers(z, np.arange(1, self.a.size + 1))
        held = _powers(z, self.delay + np.arange(self.b.size))
        A = 1 + past @ self.a
        G: Complexes = (held @ self.b) / A
        dG: Complexes = np.hstack([-past * G[:, None], held]) / A[:, None]
        root = np.sqrt(self.lam0) * self.root
        return by_gradient(f, G, dG, root, self.rows, name or f"ARX, order {self.a.size}")

    def simulate(self, u: Floats, offset: float = 0.0) -> Floats:
        """Output (N,) for the torque (N,) and c from rest, without noise."""
        B = np.concatenate([np.zeros(self.delay), self.b])
        A = np.concatenate([[1.0], self.a])
        return np.asarray(lfilter(B, A, u) + lfilter([offset], A, np.ones(len(u))))

    def predict(self, u: Floats, y: Floats, offset: float = 0.0) -> Floats:
        """One-step prediction of y (N,) from the past and c; values before the record count as zero."""
        past = np.concatenate([[0.0], -self.a])
        B = np.concatenate([np.zeros(self.delay), self.b])
        return np.asarray(lfilter(past, [1.0], y) + lfilter(B, [1.0], u) + offset)

    def stabilised(self) -> Arx:
        """With poles outside the unit circle reflected into it: the same gain at every frequency, another phase."""
        outside = [p for p in self.poles.tolist() if abs(p) >= 1]
        if not outside:
            return self
        A = np.concatenate([[1.0], self.a])
        for p in outside:
            A = _reflected(A.astype(np.complex128), p)
        gain = float(np.prod(np.abs(outside)))
        words = (*self.words, f"{len(outside)} unstable poles were reflected into the unit circle.")
        return replace(self, a=A.real[1:], b=self.b / gain, offset=self.offset / gain, words=words)


def fit_arx(
    records: Sequence[Record] | Sequence[Regular],
    order: int | tuple[int, int] | Criterion = "aic",
    *,
    largest: int | None = None,
    delay: int = 1,
    offset: bool = True,
    stable: bool = False,
) -> Arx:
    """The ARX model of one or several records.

    Args:
        records: with one interval; where a sample is missing, the rows that need it are left out.
        order: na = nb, or (na, nb), or the criterion that chooses na = nb.
        largest: order up to which the criterion looks; default 200 or a tenth of the samples.
        delay: samples from u to y; 1: by the hold, 0: with a direct term.
        offset: estimate c, one for each record.
        stable: reflect unstable poles.

    Raises:
        ValueError: an order or delay that makes no sense, irregular samples, or fewer rows than parameters.
    """
    series = on_grid(records)
    na, nb, chosen = _orders(order, series, largest)
    if na < 0 or nb < 1 or delay < 0:
        raise ValueError(f"order ({na}, {nb}), delay {delay}: need na >= 0, nb >= 1, delay >= 0")
    constants = len(series) if offset else 0
    blocks = [Lags(0, 0, na), Lags(1, delay, delay + nb - 1)] + [
        Lags(ONES + k, 0, 0) for k in range(constants)
    ]
    columns = _interleaved(na, nb, constants)
    found = factor(series, blocks, columns)
    if found.rows <= columns.size:
        raise ValueError(_too_few(found.rows, columns.size - 1, na, nb))
    n = least_order(found.R, found.rows, constants, chosen) if chosen else 0
    if chosen and n < na:
        return fit_arx(series, n, delay=delay, offset=offset, stable=stable)
    model = _model(found, columns, (na, nb, delay), series[0].interval_s)
    model = model if offset else replace(model, offset=np.zeros(len(series)))
    return model.stabilised() if stable else model


def _orders(
    order: int | tuple[int, int] | Criterion, series: Sequence[Regular], largest: int | None
) -> tuple[int, int, Criterion | None]:
    if isinstance(order, str):
        N = sum(int(record.known.sum()) for record in series)
        n = largest or max(1, min(_LARGEST, N // 10))
        return n, n, order
    na, nb = (order, order) if isinstance(order, int) else order
    return na, nb, None


def _interleaved(na: int, nb: int, constants: int) -> Ints:
    """Columns in the order c, y1, u1, y2, u2, .., y0: then the factor contains all lower orders, too."""
    pairs = [c for i in range(max(na, nb)) for c in ([1 + i] * (i < na) + [1 + na + i] * (i < nb))]
    first = [1 + na + nb + k for k in range(constants)]
    return np.array([*first, *pairs, 0], dtype=np.int64)


def _model(found: Factor, columns: Ints, orders: tuple[int, int, int], interval_s: float) -> Arx:
    (na, nb, delay), (R, N, _) = orders, found
    p = R.shape[0] - 1
    theta, root = solve(R, p)
    rss = float(np.sum((R[:, -1] - R[:, :p] @ theta) ** 2))
    lam0 = rss / (N - root.shape[1])
    place = np.argsort(columns[:-1])
    theta, root = theta[place], root[place]
    root[:na] *= -1
    words = () if root.shape[1] == p else (_not_told(root.shape[1], p),)
    a, b, c = np.split(theta, [na, na + nb])
    return Arx(interval_s, -a, b, delay, c, root[: na + nb], lam0, N, words)


def _reflected(A: Complexes, p: complex) -> Complexes:
    """A(z) (z - 1/p*) / (z - p), divided from the constant term up: stable for |p| >= 1."""
    n = A.size - 1
    Q = np.zeros(n, dtype=np.complex128)
    # A = (z - p) Q, highest power first: A_{k+1} = Q_{k+1} - p Q_k.
    above = 0.0 + 0.0j
    for k in range(n - 1, -1, -1):
        Q[k] = above = (above - A[k + 1]) / p
    Q /= Q[0]
    return np.convolve(Q, [1.0, -1 / np.conj(p)])


def _too_few(N: int, p: int, na: int, nb: int) -> str:
    return (
        f"{N} rows without a missing sample for {p} parameters of an ARX model of order ({na}, {nb}):"
        " a longer record, fewer gaps or a lower order is needed"
    )


def _not_told(rank: int, p: int) -> str:
    return (
        f"The record tells only {rank} of {p} parameters: its input is not rich enough, or it has no noise. The"
        " shortest parameter vector was taken, and the variance counts only what is told."
    )


def _powers(z: Complexes, lags: Ints) -> Complexes:
    """z^-lag (F, lags)."""
    return np.asarray(z[:, None] ** -lags.astype(np.float64), dtype=np.complex128)
