"""The black box in discrete time, as in the paper's eq. 3:  x(t+1) = A x + B u + K e,  y = C x + e."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from monitor_core.arrays import Floats
from monitor_core.identification.frequency import Complexes, FrequencyResponse, by_gradient, on_circle
from monitor_core.identification.innovations_errors import residuals


class Start(NamedTuple):
    """Initial state of a record, and reference values of its torque and output."""

    x0: Floats  # (n,) state at the first sample
    u: float  # N m
    y: float  # rad/s or rad


@dataclass(frozen=True, eq=False)
class Innovations:
    """An innovations model with n states.

    Args:
        interval_s: s.
        A: (n, n).
        B: (n,) of the torque, N m.
        C: (n,) of the output.
        K: (n,) predictor gain (A times the filter gain).
        lam0: variance of e.
        rows: samples of the output behind it.
        root: (n n + 3 n, r) with root root' the covariance of (A by rows, B, C, K); r = 0: not estimated.
        singular_values: of the subspace step, the largest first.
        words: what should be known of it.
        starts: of each record that it was fitted to.
    """

    interval_s: float
    A: Floats
    B: Floats
    C: Floats
    K: Floats
    lam0: float
    rows: int
    root: Floats
    singular_values: Floats
    words: tuple[str, ...] = ()
    starts: tuple[Start, ...] = ()

    @property
    def order(self) -> int:
        """n."""
        return len(self.A)

    @cached_property
    def poles(self) -> Complexes:
        """(n,) of the system, in z, the largest first."""
        return _eigenvalues(self.A)

    @cached_property
    def predictor_poles(self) -> Complexes:
        """(n,) of the predictor, A - K C."""
        return _eigenvalues(self.A - np.outer(self.K, self.C))

    @property
    def stable(self) -> bool:
        """All poles, of system and predictor, are inside the unit circle."""
        return bool(max(abs(self.poles[0]), abs(self.predictor_poles[0])) < 1)

    def in_units(self, su: float, sy: float) -> Innovations:
        """The model of records that were divided by su (torque) and sy (output)."""
        n = self.order
        unit = np.concatenate([np.ones(n * n), np.full(n, 1 / su), np.full(n, sy), np.full(n, 1 / sy)])
        starts = tuple(Start(start.x0, start.u * su, start.y * sy) for start in self.starts)
        return replace(
            self,
            B=self.B / su,
            C=self.C * sy,
            K=self.K / sy,
            lam0=self.lam0 * sy**2,
            root=unit[:, None] * self.root,
            starts=starts,
        )

    def response(self, frequency_hz: ArrayLike, name: str = "") -> FrequencyResponse:
        """G = C (zI - A)^-1 B = C r = l B;  dG = l dA r + l dB + dC r,  its variance by the delta method.

        Without a covariance the deviations are infinite.

        Raises:
            ValueError: a frequency beyond half the sampling frequency.
        """
        f, z = on_circle(frequency_hz, self.interval_s)
        n, name = self.order, name or f"state space, order {self.order}"
        resolvent = z[:, None, None] * np.eye(n) - self.A
        r = np.linalg.solve(resolvent, self.B[:, None].astype(np.complex128))[..., 0]
        l = np.linalg.solve(resolvent.swapaxes(1, 2), self.C[:, None].astype(np.complex128))[..., 0]
        G: Complexes = r @ self.C
        if self.root.shape[1] == 0:
            unknown = np.full(f.shape, np.inf)
            return FrequencyResponse(f, G, unknown, unknown, np.full(f.shape, float(self.rows)), name)
        dA = (l[:, :, None] * r[:, None, :]).reshape(f.size, n * n)
        dG: Complexes = np.hstack([dA, l, r, np.zeros_like(l)])
        return by_gradient(f, G, dG, self.root, self.rows, name)

    def simulate(self, u: Floats, start: Start | None = None) -> Floats:
        """Output (N,) without noise for the torque (N,), from rest unless ``start`` is given."""
        return self.predict(u, np.full(len(u), np.nan), start)

    def predict(self, u: Floats, y: Floats, start: Start | None = None) -> Floats:
        """One-step prediction (N,) of y (N,); without correction of the state where y is NaN."""
        x, u0, y0 = start or Start(np.zeros(self.order), 0.0, 0.0)
        known = np.isfinite(y)
        yhat = np.empty(len(u))
        residuals(self.A, self.B, self.C, self.K, x, u - u0, np.where(known, y - y0, 0.0), known, yhat)
        return yhat + y0


def reflected(A: Floats) -> Floats:
    """A with the eigenvalues on and outside the unit circle moved to 1/conj, just inside if on it."""
    values, vectors = np.linalg.eig(A)
    outside = np.abs(values) >= 1
    if not outside.any():
        return A
    inside = 1 / np.conj(values[outside])
    values = values.astype(np.complex128)
    values[outside] = inside * np.minimum(1.0, (1 - 1e-6) / np.abs(inside))
    return np.asarray(np.linalg.solve(vectors.T, (vectors * values).T).T.real)


def _eigenvalues(A: Floats) -> Complexes:
    p = np.asarray(np.linalg.eigvals(A), dtype=np.complex128)
    return p[np.argsort(-np.abs(p))]
