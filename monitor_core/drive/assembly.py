"""Arrays of the kernel for models: Tables for a structure, and one column of Constants for each axis."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Indices, Ints
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.friction_roles import rigid_speeds
from monitor_core.drive.parameter_names import split_name
from monitor_core.drive.structure import DELAY, Drive, MatrixTerm
from monitor_core.kernel.llvm_vectors import FOUR
from monitor_core.kernel.tables import (
    COULOMB,
    Constants,
    FrictionTerms,
    InputTerms,
    LaurentTerms,
    OutputTerms,
    Product,
    Tables,
)

_ROWS_OF = {"A": 0, "B": 1, "C": 2}


class _Slot(NamedTuple):
    """An entry of A, B, C (par = -1), or of a derivative of these with respect to theta_par."""

    group: int
    par: int
    row: int
    col: int


class _Piece(NamedTuple):
    """A Laurent term split into its monitored factors (powers of theta) and a number for the rest."""

    slot: _Slot
    multiple: float
    term: MatrixTerm
    factors: tuple[tuple[int, int], ...]


class Assembly:
    """Kernel arrays of a structure: a drive and the names of its monitored parameters.

    ``tables`` is shared by all axes of the structure; ``model_constants`` computes the numbers of one axis.
    """

    def __init__(self, drive: Drive, monitored: Sequence[str]) -> None:
        self.drive, self.monitored = drive, tuple(monitored)
        self._signs: dict[str, tuple[int, int]] = {}
        for i, name in enumerate(monitored):
            base, inverse = split_name(name)
            self._signs[base] = (i, -1 if inverse else 1)
        self._late = self.monitored.index(DELAY) if DELAY in self.monitored else -1
        self._pieces = [p for term in drive.terms if term.matrix in _ROWS_OF for p in self._split(term)]
        slots = sorted({p.slot for p in self._pieces})
        self._index = {slot: k for k, slot in enumerate(slots)}
        self._varying = sorted((p for p in self._pieces if p.factors), key=lambda p: p.slot)
        self.tables = self._tables(slots)

    def _split(self, term: MatrixTerm) -> list[_Piece]:
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
        n, p = len(self.drive.states), len(self.monitored)
        A = [s for s in slots if s.group == 0]
        inputs = self._input_products(n, p)
        outputs = self._output_products(n, p)
        factors = [factor for piece in self._varying for factor in piece.factors]
        return Tables(
            n=n,
            p=p,
            m=len(self.drive.inputs),
            mean=self.drive.mean_state,
            late=self._late,
            slots=len(slots),
            kind=_ints(self.drive.inputs),
            A_row=_ints(s.row for s in A),
            A_col=_ints(s.col for s in A),
            product=self._product(n, p),
            inputs=InputTerms(*(_ints(q[k] for q in inputs) for k in range(4))),
            outputs=_output_terms(outputs),
            friction=self._friction_terms(n, p),
            terms=LaurentTerms(
                slot=_ints(self._index[piece.slot] for piece in self._varying),
                start=_ints(np.cumsum([0] + [len(piece.factors) for piece in self._varying])),
                par=_ints(i for i, _ in factors),
                exp=_ints(e for _, e in factors),
            ),
        )

    def _product(self, n: int, p: int) -> Product:
        """Indices of the entries of A and of the A_i: for all A_i together, and by row for each A_i."""
        blocks = -(-(p + 1) // FOUR) * FOUR
        A = [s for s in self._index if s.group == 0]
        slopes = {s: k for s, k in self._index.items() if s.group == 3}
        places = sorted({(s.row, s.col) for s in slopes})
        zero = len(self._index)
        dense = [slopes.get(_Slot(3, i, r, c), zero) for r, c in places for i in range(blocks)]
        parts = sorted({(s.row, s.par) for s in slopes})
        entries = [[(s.col, k) for s, k in slopes.items() if (s.row, s.par) == part] for part in parts]
        return Product(
            n=n,
            p=p,
            blocks=blocks,
            A_start=_starts(n, [s.row for s in A]),
            A_at=_indices(s.col * blocks for s in A),
            more_start=_starts(n, [r for r, _ in places]),
            more_at=_indices(c * blocks for _, c in places),
            more_slot=_indices(dense),
            part_start=_indices(np.cumsum([0] + [len(e) for e in entries])),
            part_place=_indices(r * blocks + i for r, i in parts),
            part_at=_indices(c * blocks for e in entries for c, _ in e),
            part_slot=_indices(k for e in entries for _, k in e),
        )

    def _input_products(self, n: int, p: int) -> list[tuple[int, int, int, int]]:
        """(element, slot, input, parameter or -1): B u for x, B_i u for z_i, and B u_i where u depends on theta."""
        products = [(p * n + s.row, k, s.col, -1) for s, k in self._index.items() if s.group == 1]
        products += [(s.par * n + s.row, k, s.col, -1) for s, k in self._index.items() if s.group == 4]
        friction = [s for s in self._index if s.group == 1 and self.drive.inputs[s.col] == COULOMB]
        return products + [(i * n + s.row, self._index[s], s.col, i) for s in friction for i in range(p)]

    def _friction_terms(self, n: int, p: int) -> FrictionTerms:
        """Products with the row of the speed in A, B, A_i, B_i; none if there is no Coulomb friction."""
        state, inputs = self.drive.speed_state, self.drive.inputs
        number = inputs.count(COULOMB)
        row = {s: k for s, k in self._index.items() if s.row == state and number}
        motion = [(k, p * n + s.col, s.par) for s, k in row.items() if s.group in (0, 3)]
        motion += [(k, i * n + s.col, i) for s, k in row.items() if s.group == 0 for i in range(p)]
        of_inputs = [(k, s.col, s.par) for s, k in row.items() if s.group in (1, 4)]
        return FrictionTerms(
            number=number,
            late=self._late,
            state=state,
            filtered=int(self.drive.output != "speed"),
            motion=_output_terms(motion),
            driven=_output_terms([q for q in of_inputs if inputs[q[1]] != COULOMB]),
            braked=_output_terms([q for q in of_inputs if inputs[q[1]] == COULOMB]),
        )

    def _output_products(self, n: int, p: int) -> list[tuple[int, int, int]]:
        """(slot, element, parameter or -1): C x for yhat, C z_i and C_i x for psi_i."""
        C = [(s, k) for s, k in self._index.items() if s.group == 2]
        products = [(k, p * n + s.col, -1) for s, k in C]
        products += [(k, i * n + s.col, i) for s, k in C for i in range(p)]
        return products + [(k, p * n + s.col, s.par) for s, k in self._index.items() if s.group == 5]

    def model_constants(self, model: AxisModel, speed_scale: float) -> dict[str, Floats]:
        """V0, coef, weight, rest, rigid, theta0, lower, upper and u_scale of one axis, each as a vector.

        ``speed_scale`` [rad/s]: that of Coulomb friction, see Settings.

        Raises:
            ValueError: the drive's ``speed_state`` is not the speed at the sensor.
        """
        # The powers of a monitored parameter are in the tables, as powers of theta_i.
        fixed = {name: 1.0 if name in self._signs else v for name, v in model.nominal.items()}
        V0 = np.zeros(len(self._index))
        for p in self._pieces:
            if not p.factors:
                V0[self._index[p.slot]] += p.multiple * p.term.value(fixed)
        d = model.balance()
        return {
            "V0": V0,
            "coef": np.array([p.multiple * p.term.value(fixed) for p in self._varying]),
            "weight": d[self.tables.A_col] / d[self.tables.A_row],
            "rest": model.drive.matrix("rest", model.nominal)[:, 0],
            "rigid": rigid_speeds(model.drive, model.nominal) * (model.drive.output == "angle"),
            "theta0": model.theta0,
            "lower": model.limits[0],
            "upper": model.limits[1],
            "u_scale": _input_scales(model, speed_scale),
        }


def without_friction(tables: Tables) -> Tables:
    """The tables without Coulomb friction, which saves its computation for axes that have none."""
    return tables._replace(friction=tables.friction._replace(number=0))


def fill(target: Constants, axis: int, values: dict[str, Floats]) -> None:
    """Write named vectors or numbers into the column of one axis.

    Raises:
        KeyError: a constant is missing or unknown.
    """
    if set(values) != set(Constants._fields):
        raise KeyError(f"constants {sorted(set(values) ^ set(Constants._fields))}")
    for name, value in values.items():
        getattr(target, name)[..., axis] = value


def _input_scales(model: AxisModel, speed_scale: float) -> Floats:
    """Factor of the measured speed or angle in the argument of an input (m,).

    At nominal values a flange has ``ratio`` times the angle and speed of the sensor.  The angle is measured.  The speed
    is measured, or it is that of the predictor: C A x, or C x if the speed is the output.  This depends on
    x[speed_state] only, so the factor of friction includes the coefficient of this state.
    """
    drive = model.drive
    scale, friction = drive.matrix("ratio", model.nominal)[:, 0], np.array(drive.inputs) == COULOMB
    scale[friction] /= speed_scale
    if friction.any() and drive.speed_state >= 0:
        A, _, C = model.matrices()
        sensor = (C if drive.output == "speed" else C @ A)[0, drive.speed_state]
        if sensor == 0:
            state = drive.states[drive.speed_state].name
            raise ValueError(f"Coulomb friction needs the speed at the sensor, which {state} is not")
        scale[friction] *= sensor
    return scale


def _ordered(factors: dict[int, int]) -> tuple[tuple[int, int], ...]:
    return tuple((i, e) for i, e in sorted(factors.items()) if e != 0)


def _output_terms(products: Sequence[tuple[int, int, int]]) -> OutputTerms:
    """The output terms of products (slot, element, parameter or -1)."""
    return OutputTerms(*(_ints(q[k] for q in products) for k in range(3)))


def _ints(values: object) -> Ints:
    return np.array(list(values), dtype=np.int64)  # type: ignore[call-overload]


def _starts(n: int, rows: Sequence[int]) -> Indices:
    """Index at which each of n rows begins in a list that is sorted by rows, and the end of the list."""
    return _indices(np.searchsorted(rows, np.arange(n + 1)))


def _indices(values: object) -> Indices:
    return _ints(values).astype(np.uint64)
