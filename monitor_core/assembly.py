"""From models to the kernel's arrays: Tables for a structure, one column of Constants for each axis."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.kernel.tables import COULOMB, Constants, Floats, Ints, Tables
from monitor_core.model import AxisModel, Drive, Term, split_name

_ROWS_OF = {"A": 0, "B": 1, "C": 2}


class _Slot(NamedTuple):
    """An entry of A, B, C (par = -1) or of its derivative with respect to theta_par."""

    group: int
    par: int
    row: int
    col: int


class _Piece(NamedTuple):
    """A Laurent term split into what is monitored (factors of theta) and what is not (folded into a number)."""

    slot: _Slot
    multiple: float
    term: Term
    factors: tuple[tuple[int, int], ...]


class Assembly:
    """The kernel's view of a structure: a drive and the names of its monitored parameters.

    ``tables`` is shared by all axes of the structure; ``constants_of`` fills the numbers of one axis.
    """

    def __init__(self, drive: Drive, monitored: Sequence[str]) -> None:
        self.drive, self.monitored = drive, tuple(monitored)
        self._signs = {split_name(name)[0]: _sign(i, name) for i, name in enumerate(monitored)}
        self._pieces = [p for term in drive.terms if term.matrix in _ROWS_OF for p in self._split(term)]
        slots = sorted({p.slot for p in self._pieces})
        self._index = {slot: k for k, slot in enumerate(slots)}
        self._varying = [p for p in self._pieces if p.factors]
        self.tables = self._tables(slots)

    def _split(self, term: Term) -> list[_Piece]:
        """The term and its derivatives d/dtheta_i = e_i c theta_i^(e_i - 1) ..., which are terms of the same kind."""
        factors: dict[int, int] = {}
        for name, e in term.powers:
            if name in self._signs:
                i, sign = self._signs[name]
                factors[i] = factors.get(i, 0) + sign * e
        group = _ROWS_OF[term.matrix]
        pieces = [_Piece(_Slot(group, -1, term.row, term.col), 1.0, term, _ordered(factors))]
        for i, e in factors.items():
            rest = {**factors, i: e - 1}
            pieces.append(_Piece(_Slot(group + 3, i, term.row, term.col), float(e), term, _ordered(rest)))
        return pieces

    def _tables(self, slots: list[_Slot]) -> Tables:
        starts = np.cumsum([0] + [len(p.factors) for p in self._varying])
        flat = [factor for p in self._varying for factor in p.factors]
        return Tables(
            n=len(self.drive.states),
            p=len(self.monitored),
            m=len(self.drive.inputs),
            speed_state=self.drive.speed_state,
            filtered_speed=int(self.drive.output == "angle" and COULOMB in self.drive.inputs),
            ends=_ints(sum(s.group <= g for s in slots) for g in range(6)),
            row=_ints(s.row for s in slots),
            col=_ints(s.col for s in slots),
            par=_ints(s.par for s in slots),
            kind=_ints(self.drive.inputs),
            term_slot=_ints(self._index[p.slot] for p in self._varying),
            factor_start=_ints(starts),
            factor_par=_ints(i for i, _ in flat),
            factor_exp=_ints(e for _, e in flat),
        )

    def model_constants(self, model: AxisModel) -> dict[str, Floats]:
        """V0, coef, weight, rest, theta0, lower and upper of one axis, each as a vector."""
        fixed = {name: (1.0 if name in self._signs else v) for name, v in model.nominal.items()}
        V0 = np.zeros(len(self._index))
        for p in self._pieces:
            if not p.factors:
                V0[self._index[p.slot]] += p.multiple * p.term.value(fixed)
        d = model.balance()
        entries = int(self.tables.ends[0])
        return {
            "V0": V0,
            "coef": np.array([p.multiple * p.term.value(fixed) for p in self._varying]),
            "weight": d[self.tables.col[:entries]] / d[self.tables.row[:entries]],
            "rest": model.drive.matrix("rest", model.nominal)[:, 0],
            "theta0": model.theta0,
            "lower": model.limits[0],
            "upper": model.limits[1],
        }


def fill(target: Constants, axis: int, values: dict[str, Floats]) -> None:
    """Write named vectors or numbers into the column of one axis.

    Raises:
        KeyError: a constant is missing or unknown.
    """
    if set(values) != set(Constants._fields):
        raise KeyError(f"constants {sorted(set(values) ^ set(Constants._fields))}")
    for name, value in values.items():
        getattr(target, name)[..., axis] = value


def _sign(i: int, name: str) -> tuple[int, int]:
    return i, -1 if split_name(name)[1] else 1


def _ordered(factors: dict[int, int]) -> tuple[tuple[int, int], ...]:
    return tuple((i, e) for i, e in sorted(factors.items()) if e != 0)


def _ints(values: object) -> Ints:
    return np.array(list(values), dtype=np.int64)  # type: ignore[call-overload]
