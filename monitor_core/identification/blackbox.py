"""Innovations models by prediction errors: a subspace start, then Gauss-Newton with exact derivatives.

All of A, B, C, K are free.  A change of state coordinates changes nothing else, so each step goes into the 3 n
directions orthogonal to such changes (McKelvey, Helmersson and Ribarits, Automatica 40 (2004): data-driven local
coordinates): minimal, and without the poor conditioning of canonical forms at small intervals.  With them, for each
record: its state at the first sample and an offset of its torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.innovations import Innovations, Start, reflected
from monitor_core.identification.innovations_errors import residuals, slopes
from monitor_core.identification.record import Record
from monitor_core.identification.subspace import Rule, subspace_of
from monitor_core.identification.uniform_grid import Regular, of_size_one, on_grid

_RADIUS = 1 - 1e-9
"""Of the largest pole of predictor and, where it must be stable, of the system."""
_TARGET = 1 - 1e-6
"""Where a pole that wants to leave the unit circle is kept: a time constant of a million samples."""
_ENOUGH = 1e-4
"""Decrease of the sum of squares, in units of lam0, that ends the iteration: a hundredth of a standard deviation."""
_STUCK = 1e8
"""Damping at which no step in the direction of descent helps any more."""
_HIDDEN = 1e-14
"""Of the largest eigenvalue of the information matrix, scaled: a direction that the records do not tell."""


class System(NamedTuple):
    """A, B, C, K as one vector, in units in which u and y have the size 1."""

    n: int
    theta: Floats  # (n n + 3 n,)

    @property
    def parts(self) -> tuple[Floats, Floats, Floats, Floats]:
        """A (n, n), B, C, K (n,)."""
        n = self.n
        A, rest = self.theta[: n * n].reshape(n, n), self.theta[n * n :].reshape(3, n)
        return A, rest[0], rest[1], rest[2]

    def radius(self, stable: bool) -> float:
        """Magnitude of the predictor's largest pole; optionally of the system's, too."""
        A, _, C, K = self.parts
        predictor = float(np.abs(np.linalg.eigvals(A - np.outer(K, C))).max())
        return max(predictor, float(np.abs(np.linalg.eigvals(A)).max())) if stable else predictor

    def moved(self, step: Floats) -> System:
        """theta + step (n n + 3 n,)."""
        return System(self.n, self.theta + step)

    def inside(self) -> System:
        """The vector with poles of the system that a step has moved across the unit circle moved back."""
        n = self.n
        return System(n, np.concatenate([reflected(self.parts[0]).ravel(), self.theta[n * n :]]))

    def directions(self) -> Floats:
        """(n n + 3 n, 3 n) orthonormal, orthogonal to  A E - E A, -E B, C E, -E K  for every E."""
        A, B, C, K = self.parts
        n, eye = self.n, np.eye(self.n)
        # Column (i, j) of each part for E = e_i e_j'.
        commutator = np.einsum("ai,bj->abij", A, eye) - np.einsum("ai,jb->abij", eye, A)
        rest = [
            -np.einsum("ai,j->aij", eye, B),
            np.einsum("i,bj->bij", C, eye),
            -np.einsum("ai,j->aij", eye, K),
        ]
        tangent = np.vstack([commutator.reshape(n * n, n * n), *(part.reshape(n, n * n) for part in rest)])
        return np.asarray(np.linalg.qr(tangent, mode="complete")[0][:, n * n :])


@dataclass(frozen=True, eq=False)
class Data:
    """The records in those units, their state at the first sample and the offset of the torque."""

    series: tuple[Regular, ...]

    def cost(self, system: System, nuisance: Floats) -> float:
        """Sum of squares of all prediction errors; infinite where they overflow."""
        total = 0.0
        for record, free in zip(self.series, nuisance, strict=True):
            yhat, u = np.empty(record.u.size), record.u + free[-1]
            total += residuals(*system.parts, free[:-1], u, record.y, record.y_known, yhat)
        return total if np.isfinite(total) else np.inf

    def normal(self, system: System, nuisance: Floats, P: Floats) -> tuple[Floats, Floats, float]:
        """H (q, q) and g (q,) of  cost(delta) = cost - 2 g' delta + delta' H delta,  and the cost.

        Args:
            system: the model.
            nuisance: (records, n + 1).
            P: (n n + 3 n, r) directions.

        delta is along P first, then the nuisance parameters of each record; q = r + records (n + 1).
        """
        n, r = system.n, P.shape[1]
        D = P.T
        dA, rest = np.ascontiguousarray(D[:, : n * n]).reshape(r, n, n), D[:, n * n :].reshape(r, 3, n)
        dB, dC, dK = (np.ascontiguousarray(rest[:, k]) for k in range(3))
        q = r + nuisance.size
        H, g, total = np.zeros((q, q)), np.zeros(q), 0.0
        for k, (record, free) in enumerate(zip(self.series, nuisance, strict=True)):
            N = record.u.size
            psi, eps = np.empty((N, r + n + 1)), np.empty(N)
            u = record.u + free[-1]
            slopes(*system.parts, free[:-1], dA, dB, dC, dK, u, record.y, record.y_known, psi, eps)
            own = np.concatenate([np.arange(r), r + k * (n + 1) + np.arange(n + 1)])
            H[np.ix_(own, own)] += psi.T @ psi
            g[own] += psi.T @ eps
            total += float(eps @ eps)
        return H, g, total


def fit_blackbox(
    records: Sequence[Record] | Sequence[Regular],
    order: int | Rule = "singular-values",
    *,
    past: int | None = None,
    stable: bool = True,
    iterations: int = 50,
) -> Innovations:
    """The innovations model of least squared prediction errors, with the covariance of its matrices.

    Args:
        records: with one interval; where y is missing the prediction runs on, where a sample was lost the torque
            counts as held.
        order: n, or the rule by which the subspace start chooses it.
        past: as in fit_subspace.
        stable: keep the poles of the system inside the unit circle; those of the predictor always are.
        iterations: at most.

    Raises:
        ValueError: as fit_subspace; more parameters than samples.
    """
    given = on_grid(records)
    series, su, sy = of_size_one(given)
    start, data = subspace_of(series, order, past), Data(series)
    n, known = start.order, sum(int(record.y_known.sum()) for record in series)
    dof = known - 3 * n - len(series) * (n + 1)
    if dof <= 0:
        raise ValueError(f"{known} samples for {known - dof} parameters of order {n}: too few")
    theta = np.concatenate([start.A.ravel(), start.B, start.C, start.K])
    system, nuisance, converged = refine(System(n, theta), data, dof, stable, iterations)
    model = _model(system, data, nuisance, dof, start)
    words = (*start.words, *(() if converged else (f"Not converged after {iterations} iterations.",)))
    model = replace(model, rows=known, words=words).in_units(su, sy)
    starts = [
        Start(free[:-1], *_middle(record, su * free[-1]))
        for record, free in zip(given, nuisance, strict=True)
    ]
    return replace(model, starts=tuple(starts))


def refine(
    system: System, data: Data, dof: int, stable: bool, iterations: int
) -> tuple[System, Floats, bool]:
    """Levenberg and Marquardt's method: system, nuisance parameters (records, n + 1), whether it converged."""
    nuisance = np.zeros((len(data.series), system.n + 1))
    # For a given system the errors are linear in these.
    H, g, _ = data.normal(system, nuisance, np.empty((system.theta.size, 0)))
    nuisance = nuisance + np.linalg.lstsq(H, g)[0].reshape(nuisance.shape)
    damping = 1e-4
    for _ in range(iterations):
        P = system.directions()
        H, g, cost = data.normal(system, nuisance, P)
        while True:
            damped = H + damping * np.diag(np.diag(H) + 1e-300)
            delta = np.asarray(np.linalg.solve(damped, g), dtype=np.float64)
            if stable:
                delta = confined(system, P, damped, delta)
            moved, free = (
                system.moved(P @ delta[: P.shape[1]]),
                nuisance + delta[P.shape[1] :].reshape(nuisance.shape),
            )
            moved = moved.inside() if stable else moved
            after = data.cost(moved, free) if moved.radius(stable) < _RADIUS else np.inf
            if after <= cost:
                break
            damping *= 10
            if damping > _STUCK:
                return system, nuisance, True
        system, nuisance, damping = moved, free, max(damping / 10, 1e-12)
        if (cost - after) * dof < _ENOUGH * cost:
            return system, nuisance, True
    return system, nuisance, False


def confined(system: System, P: Floats, H: Floats, delta: Floats) -> Floats:
    """The step, or, if a pole of the system would leave the circle, the best one that moves it half way there.

    |lambda| moves by  Re(lambda* w dA v) / |lambda|  for the right and left eigenvectors v and w, w v = 1.
    """
    n, r = system.n, P.shape[1]
    values, V = np.linalg.eig(system.parts[0])
    size, W = np.maximum(np.abs(values), 1e-12), np.linalg.inv(V)
    moves = np.einsum("ka,abi,bk->ki", W, P[: n * n].reshape(n, n, r), V)
    c = (np.conj(values / size)[:, None] * moves).real
    k = int(np.argmax(size + c @ delta[:r]))
    if size[k] + c[k] @ delta[:r] < _RADIUS:
        return delta
    e = np.concatenate([c[k], np.zeros(delta.size - r)])
    s = np.linalg.solve(H, e)
    return np.asarray(delta - s * (e @ delta - (_TARGET - size[k]) / 2) / (e @ s))


def _model(system: System, data: Data, nuisance: Floats, dof: int, start: Innovations) -> Innovations:
    P = system.directions()
    H, _, cost = data.normal(system, nuisance, P)
    d = 1 / np.sqrt(np.diag(H) + 1e-300)
    values, vectors = np.linalg.eigh(d[:, None] * H * d)
    seen = values > _HIDDEN * values[-1]
    inverse = d[:, None] * vectors[:, seen] / np.sqrt(values[seen])
    root = P @ inverse[: P.shape[1]] * np.sqrt(cost / dof)
    A, B, C, K = system.parts
    return replace(start, A=A, B=B, C=C, K=K, lam0=cost / dof, root=root)


def _middle(record: Regular, offset: float) -> tuple[float, float]:
    """Reference values of torque, with its offset, and output of a record."""
    return float(record.u[record.u_known].mean() - offset), float(record.y[record.y_known].mean())
