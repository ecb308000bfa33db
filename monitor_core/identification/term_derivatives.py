"""A, B, C of a drive and their derivatives with respect to its free parameters, all terms at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.structure import Drive, Matrix, split_name

_PARTS: tuple[Matrix, ...] = ("A", "B", "C", "rest", "ratio")


class Linear(NamedTuple):
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


class Structure:
    """The Laurent terms of a drive as arrays:  term_j = c_j prod_i v_i^E_ji,  v the parameters' values.

    A free parameter "1/Ja" counts as a value of its own, Ja^-1.  ``d`` (n,) is the unit of each state.

    Raises:
        KeyError: a free name that the drive does not have.
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
        self._constant = np.concatenate([np.zeros(self._ends[4]), drive.matrix("ratio", _ones(drive))[:, 0]])
        self._constant[entry[entry >= self._ends[4]]] = 0.0
        self._unit = np.concatenate(
            [(d / d[:, None]).ravel(), np.repeat(1 / d, m), d, 1 / d, np.ones(m)],
        )

    def _place(self, part: Matrix, row: int, col: int) -> int:
        k = _PARTS.index(part)
        width = self._shapes[part][1] if part in ("A", "B") else 1
        return int(self._ends[k]) + (col if part == "C" else row * width + col)

    def at(self, values: Mapping[str, float]) -> Linear:
        """The drive at these values of all its parameters; complex ones pass through."""
        v = np.array([values[name] for name in self.names])
        v[self._inverted] = 1 / v[self._inverted]
        terms = self._coefficient * np.prod(v**self._exponent, axis=1)
        slopes = np.empty((terms.size, len(self._free)), dtype=terms.dtype)
        for k, i in enumerate(self._free):
            slopes[:, k] = terms * self._exponent[:, i] / v[i] if v[i] else self._slopes(v, i)
        flat = self._constant + self._sums @ terms
        return Linear(
            *self._parts(flat * self._unit), *self._parts(self._sums @ slopes * self._unit[:, None])
        )

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
        return [
            s.reshape(*self._shapes[part], *flat.shape[1:]) for part, s in zip(_PARTS, split, strict=True)
        ]


def _ones(drive: Drive) -> dict[str, float]:
    return {p.name: 1.0 for p in drive.parameters}
