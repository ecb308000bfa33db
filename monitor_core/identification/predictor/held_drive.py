"""A drive with inputs held over an interval, and its derivatives, computed once for each distinct interval."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, Ints
from monitor_core.drive.discretization import zero_order_hold_slopes
from monitor_core.drive.parameter_names import split_name
from monitor_core.drive.structure import Drive, Matrix
from monitor_core.kernel.sample_interval import LOST
from monitor_core.kernel.tables import COULOMB, TORQUE


class HeldDrive(NamedTuple):
    """x(t + h) = X (x, u), X = [Ad Bd], for G intervals; derivatives have the parameter as second axis."""

    X: Floats  # (G, n, n + m)
    dX: Floats  # (G, p, n, n + m)


def hold(system: LinearDrive, intervals_s: Floats) -> HeldDrive:
    """The drive over these intervals (G,), in s, exactly."""
    dA, dB = (np.moveaxis(slopes, 2, 0) for slopes in (system.dA, system.dB))
    return HeldDrive(*zero_order_hold_slopes(system.A, system.B, dA, dB, intervals_s))


def hold_late(system: LinearDrive, torque: NDArray[np.bool_], intervals_s: Floats, delay_s: float) -> HeldDrive:
    """The drive with its torque delayed by tau_d: until then the previous torque acts, as a further input.

        [t, t + tau_d): u[k-1],   [t + tau_d, t + h): u[k];   the other inputs are not delayed

    ``torque`` (m,) marks the inputs that are the motor torque.  The derivative with respect to tau_d is the last one. A
    delay beyond the interval ends with it, as in the monitor.
    """
    n, m = system.B.shape
    held = hold(system, intervals_s)
    late = np.minimum(delay_s, intervals_s)
    rest = hold(system, intervals_s - late)
    G, p = held.dX.shape[:2]
    X, dX = np.empty((G, n, n + m + 1)), np.zeros((G, p + 1, n, n + m + 1))
    columns = np.flatnonzero(np.concatenate([np.zeros(n, bool), torque]))
    for to, all_, last in ((X, held.X, rest.X), (dX[:, :p], held.dX, rest.dX)):
        to[..., : n + m] = all_
        to[..., columns] = last[..., columns]
        to[..., n + m] = (all_[..., columns] - last[..., columns]).sum(axis=-1)
    # Derivative with respect to tau of the effect over the rest of the interval: its integrand, exp(A (h - tau)) B.
    edge = (rest.X[:, :, :n] @ system.B[:, torque]) * (delay_s <= intervals_s)[:, None, None]
    dX[:, p][..., columns] = -edge
    dX[:, p, :, n + m] = edge.sum(axis=-1)
    return HeldDrive(X, dX)


# --- A, B, C of a drive and their derivatives with respect to its free parameters, all terms at once ------------------


_PARTS: tuple[Matrix, ...] = ("A", "B", "C", "rest", "ratio")


class LinearDrive(NamedTuple):
    """A drive at one theta, in states x_i / d_i; derivatives have the parameter as last axis."""

    A: Floats  # (n, n)
    B: Floats  # (n, m)
    C: Floats  # (n,)
    rest: Floats  # (n,) state of rigid motion with output 1
    ratio: Floats  # (m,) angle at the flange of each input while the sensor's is 1
    dA: Floats  # (n, n, p)
    dB: Floats  # (n, m, p)
    dC: Floats  # (n, p)
    drest: Floats  # (n, p)
    dratio: Floats  # (m, p)

    def with_inputs(self, which: NDArray[np.bool_]) -> LinearDrive:
        """The same drive with these inputs (m,) only."""
        return self._replace(
            B=self.B[:, which], dB=self.dB[:, which], ratio=self.ratio[which], dratio=self.dratio[which]
        )


class Structure:
    """The Laurent terms of a drive as arrays:  term_j = c_j prod_i v_i^E_ji,  v the parameters' values.

    A free parameter "1/Ja" counts as a value of its own, Ja^-1.  ``d`` (n,) is the unit of each state.
    """

    def __init__(self, drive: Drive, free: Sequence[str], d: Floats) -> None:
        n, m = len(drive.states), len(drive.inputs)
        self.names = [p.name for p in drive.parameters]
        self._shapes = {"A": (n, n), "B": (n, m), "C": (n,), "rest": (n,), "ratio": (m,)}
        self._ends = np.cumsum([0] + [int(np.prod(self._shapes[part])) for part in _PARTS])
        self._coefficient = np.array([term.coefficient for term in drive.terms])
        self._exponent = np.zeros((len(drive.terms), len(self.names)), dtype=np.int64)
        for row, term in zip(self._exponent, drive.terms, strict=True):
            for name, e in term.powers:
                row[self.names.index(name)] += e
        entry = np.array([self._place(t.matrix, t.row, t.col) for t in drive.terms], dtype=np.int64)
        self._sums = np.zeros((self._ends[-1], len(drive.terms)))
        self._sums[entry, np.arange(entry.size)] = 1.0
        self._free = [self.names.index(split_name(name)[0]) for name in free]
        self._inverted = [i for i, name in zip(self._free, free, strict=True) if split_name(name)[1]]
        self._exponent[:, self._inverted] *= -1
        self._constant = np.concatenate(
            [np.zeros(self._ends[4]), drive.matrix("ratio", dict.fromkeys(self.names, 1.0))[:, 0]]
        )
        self._constant[entry[entry >= self._ends[4]]] = 0.0
        self._unit = np.concatenate([(d / d[:, None]).ravel(), np.repeat(1 / d, m), d, 1 / d, np.ones(m)])

    def _place(self, part: Matrix, row: int, col: int) -> int:
        k = _PARTS.index(part)
        width = self._shapes[part][1] if part in ("A", "B") else 1
        return int(self._ends[k]) + (col if part == "C" else row * width + col)

    def at(self, values: Mapping[str, float]) -> LinearDrive:
        """The drive at these values of all its parameters; complex ones pass through."""
        v = np.array([values[name] for name in self.names])
        v[self._inverted] = 1 / v[self._inverted]
        terms = self._coefficient * np.prod(v**self._exponent, axis=1)
        slopes = np.empty((terms.size, len(self._free)), dtype=terms.dtype)
        for k, i in enumerate(self._free):
            slopes[:, k] = terms * self._exponent[:, i] / v[i] if v[i] else self._slopes(v, i)
        flat = self._constant + self._sums @ terms
        return LinearDrive(*self._parts(flat * self._unit), *self._parts(self._sums @ slopes * self._unit[:, None]))

    def _slopes(self, v: Floats, i: int) -> Floats:
        """d term / d v_i = c E_i v_i^(E_i - 1) ..., also where v_i = 0."""
        out = np.zeros(self._coefficient.size, dtype=v.dtype)
        rows = np.flatnonzero(self._exponent[:, i])
        lower = self._exponent[rows]
        lower[:, i] -= 1
        out[rows] = self._coefficient[rows] * self._exponent[rows, i] * np.prod(v**lower, axis=1)
        return out

    def _parts(self, flat: Floats) -> list[Floats]:
        split = np.split(flat, self._ends[1:-1])
        return [s.reshape(*self._shapes[part], *flat.shape[1:]) for part, s in zip(_PARTS, split, strict=True)]


# --- Mean speed for a fixed theta: the angle since the last sample over the interval ----------------------------------


# The state s of Drive.with_mean_speed, s' = speed, is zero after a sample: no column of [Ad Bd] needs it.  Its row
# over h is the mean speed.  After lost samples that is over the drive's own, last interval, as in the monitor.


def with_mean_state(held: HeldDrive, s: int, over_s: Floats) -> HeldDrive:
    """The held drive with the mean of the state s over ``over_s`` (G,) [s] in place of s, which starts at zero."""
    X, dX = held.X.copy(), held.dX.copy()
    X[:, s] /= over_s[:, np.newaxis]
    dX[:, :, s] /= over_s[:, np.newaxis, np.newaxis]
    X[:, :, s] = 0.0
    dX[:, :, :, s] = 0.0
    return HeldDrive(X, dX)


def hold_mean(
    system: LinearDrive,
    torque: NDArray[np.bool_],
    intervals_s: Floats,
    late_s: float | None,
    s: int,
    interval_s: float,
) -> HeldDrive:
    """The drive over intervals (G,) [s], the nominal one ``interval_s``; ``late_s`` as in ``hold_late``, or None."""
    late = np.minimum(late_s or 0.0, intervals_s)
    own_s = np.where(intervals_s > LOST * interval_s, np.minimum(intervals_s - late, interval_s), 0.0)
    before_s = intervals_s - own_s
    held = hold(system, before_s) if late_s is None else hold_late(system, torque, before_s, late_s)
    found = with_mean_state(held, s, before_s)
    for g in np.flatnonzero(own_s).tolist():
        own = with_mean_state(hold(system, own_s[g : g + 1]), s, own_s[g : g + 1])
        found.X[g], found.dX[g] = _after(own, HeldDrive(found.X[g : g + 1], found.dX[g : g + 1]))
    return found


def _after(own: HeldDrive, before: HeldDrive) -> tuple[Floats, Floats]:
    """The last interval, after the part before it; in the last interval the delayed torque no longer acts."""
    n, k = own.X.shape[1:]
    A, B, X = own.X[0, :, :n], own.X[0, :, n:], before.X[0]
    out, slopes = A @ X, A @ before.dX[0]
    out[:, n:k] += B
    slopes[: own.dX.shape[1]] += own.dX[0, :, :, :n] @ X
    slopes[: own.dX.shape[1], :, n:k] += own.dX[0, :, :, n:]
    return out, slopes


# --- The speed at the middle of an interval by state and inputs, which friction depends on (kernel/friction.py) -------


class HalfIntervalSpeed(NamedTuple):
    """Half an interval times the acceleration; derivatives have the parameter as last axis."""

    half: Floats  # (G, n + m') by the state and the inputs but friction; m' = m + 1: the last is the torque before
    dhalf: Floats  # (G, n + m', q)
    braked: Floats  # (G, m) by each friction
    dbraked: Floats  # (G, m, q)


def middle_speed(
    system: LinearDrive, kinds: Ints, state: int | None, intervals_s: Floats, late_s: float | None
) -> HalfIntervalSpeed:
    """Over intervals (G,) [s], of the speed in ``state``, or None: of the output, which is the speed.

    ``late_s``: delay of the torque, with the derivative with respect to it as the last one; or None.
    """
    n = len(system.A)
    AB, dAB = np.hstack([system.A, system.B]), np.hstack([system.dA, system.dB])
    if state is None:
        row = system.C @ AB
        slopes = np.einsum("rp,rc->cp", system.dC, AB) + np.einsum("r,rcp->cp", system.C, dAB)
    else:
        row, slopes = AB[state], dAB[state]
    half, dhalf = (np.multiply.outer(intervals_s / 2, part) for part in (row, slopes))
    friction = kinds == COULOMB
    braked, dbraked = (part[:, n:] * friction.reshape(shape) for part, shape in ((half, -1), (dhalf, (-1, 1))))
    half[:, n:][:, friction] = 0.0
    dhalf[:, n:][:, friction] = 0.0
    if late_s is None:
        return HalfIntervalSpeed(half, dhalf, braked, dbraked)
    return HalfIntervalSpeed(
        *_late(half, dhalf, n + np.flatnonzero(kinds == TORQUE), intervals_s, late_s),
        braked,
        np.concatenate([dbraked, np.zeros((*braked.shape, 1))], axis=2),
    )


def _late(half: Floats, dhalf: Floats, torque: Ints, intervals_s: Floats, late_s: float) -> tuple[Floats, Floats]:
    """Split the effect of the torque: a share (1 - late / h)^2 of the held torque, the rest of the torque before.

    See ``mean_torque_share`` of the kernel.
    """
    rest = (1 - np.minimum(late_s, intervals_s) / intervals_s)[:, np.newaxis]
    out = np.concatenate([half, (1 - rest**2) * half[:, torque]], axis=1)
    out[:, torque] *= rest**2
    slopes = np.concatenate([dhalf, (1 - rest**2)[..., np.newaxis] * dhalf[:, torque]], axis=1)
    slopes[:, torque] *= (rest**2)[..., np.newaxis]
    of_delay = np.zeros(out.shape)
    of_delay[:, torque] = -2 * rest / intervals_s[:, np.newaxis] * half[:, torque]
    of_delay[:, -1:] = -of_delay[:, torque]
    return out, np.concatenate([slopes, of_delay[..., np.newaxis]], axis=2)
