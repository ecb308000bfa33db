"""One axis: a drive with nominal values, and the parameters to be monitored.

``Drive`` (structure.py) is the structure of a family of axes, ``AxisModel`` is one axis of it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.discretization import balance_of
from monitor_core.drive.parameter_names import split_name, value_of, with_values
from monitor_core.drive.structure import INERTIA, Drive, Parameter
from monitor_core.kernel.tables import COULOMB, OF_ANGLE


class NominalValueError(ValueError):
    """A nominal value that is impossible for its parameter; ``reason`` says why, without name and value."""

    def __init__(self, name: str, value: float, reason: str) -> None:
        super().__init__(f"nominal {name} = {value}: {reason}")
        self.reason = reason


@dataclass(frozen=True)
class AxisModel:
    """One axis: a drive, its nominal values (SI), and the monitored parameters theta.

    ``nominal`` may be given by the names of the drive's parameters or, if these are merged, by the names of the drawn
    parameters.  The attribute then holds exactly the parameters of the drive.  A monitored name ``1/Ja`` means that
    theta holds the reciprocal of ``Ja``.  ``scales``: size of a parameter whose nominal value is zero (an offset),
    which sets the threshold of its test.  ``bounds``: limits of theta; default for a positive parameter: a tenth to ten
    times its nominal value.

    Raises:
        KeyError: the drive does not have a name, or a nominal value is missing.
        ValueError: a value is not finite, or not positive where it must be; a parameter is monitored twice; the
            reciprocal of zero is monitored; a parameter has no size; bounds do not contain the nominal value; an input
            of the drive cannot be computed from its output.
    """

    drive: Drive
    nominal: Mapping[str, float]
    monitored: tuple[str, ...]
    scales: Mapping[str, float] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._check_inputs()
        for name, value in self.nominal.items():
            _check_value(name, value, self.drive.given_as(name))
        complete = self.drive.complete(self.nominal)
        for p in self.drive.parameters:
            _check_value(p.name, complete[p.name], p)
        object.__setattr__(self, "nominal", complete)
        self._check_monitored()
        self._check_sizes()
        self._check_bounds()

    def _check_inputs(self) -> None:
        kinds, output = self.drive.inputs, self.drive.output
        if output != "angle" and not set(OF_ANGLE).isdisjoint(kinds):
            raise ValueError("gravity depends on the angle: measure the angle")
        if output != "speed" and COULOMB in kinds and self.drive.speed_state < 0:
            raise ValueError(
                f"Coulomb friction depends on the speed, and no state is that of the {output} sensor: measure the speed"
            )

    def _check_monitored(self) -> None:
        bases = [split_name(name)[0] for name in self.monitored]
        for name in self.monitored:
            self.drive.parameter(name)
            base, inverse = split_name(name)
            if bases.count(base) > 1:
                raise ValueError(f"{base} is monitored twice")
            if inverse and self.nominal[base] == 0:
                raise ValueError(f"{name} does not exist: its nominal value is 0")

    def _check_sizes(self) -> None:
        for name in self.monitored:
            scale = self._size(name)
            if scale == 0 and name not in self.scales:
                raise ValueError(f"{name} has the nominal value 0: give its scale, which sets its threshold")
            if not 0 < scale < math.inf:
                raise ValueError(f"scale of {name} = {scale}: must be finite and greater than zero")

    def _check_bounds(self) -> None:
        for name in self.monitored:
            (lower, upper), value = self._limits(name), value_of(self.nominal, name)
            positive = self.drive.parameter(name).positive
            if not lower < value < upper or (positive and lower <= 0):
                need = "0 < lower < nominal < upper" if positive else "lower < nominal < upper"
                raise ValueError(f"bounds of {name} = {lower}, {upper}: need {need} = {value}")

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The monitored parameters, under the names of ``monitored``, which may be reciprocals."""
        return tuple(self.drive.parameter(name) for name in self.monitored)

    def carried_weight(self) -> tuple[str, ...]:
        """Parameters of the weight that the axis bears; empty if it bears none, or if one of them is monitored."""
        weight = tuple(name for name in self.drive.weights() if self.nominal[name] != 0)
        return weight if {split_name(name)[0] for name in self.monitored}.isdisjoint(weight) else ()

    def arm_inertia(self) -> str | None:
        """Name of the inertia that a payload changes; None: there is none, or inertias are monitored."""
        inertias = [p.name for p in self.drive.parameters if p.unit == INERTIA and self.nominal[p.name] > 0]
        monitored = {split_name(name)[0] for name in self.monitored}
        return inertias[-1] if inertias and monitored.isdisjoint(inertias) else None

    @cached_property
    def theta0(self) -> Floats:
        """Nominal theta (p,)."""
        return np.array([value_of(self.nominal, name) for name in self.monitored], dtype=float)

    @cached_property
    def scale(self) -> Floats:
        """Size s_i of each theta_i (p,): |theta0_i|, or its entry in ``scales``."""
        return np.array([self._size(name) for name in self.monitored], dtype=float)

    @cached_property
    def limits(self) -> Floats:
        """Lower and upper bounds of theta (2, p)."""
        pairs = [self._limits(name) for name in self.monitored]
        return np.array(pairs, dtype=float).reshape(-1, 2).T

    def values(self, theta: Sequence[float] | Floats) -> dict[str, float]:
        """All parameter values with theta in place of the nominal ones."""
        return with_values(self.nominal, self.monitored, theta)

    def matrices(self, theta: Sequence[float] | Floats | None = None) -> tuple[Floats, Floats, Floats]:
        """A (n, n), B (n, m) and C (1, n) at theta (p,); default: at the nominal values."""
        A, B, C = self._at_nominal if theta is None else self.drive.matrices(self.values(theta))
        return A.copy(), B.copy(), C.copy()

    @cached_property
    def _at_nominal(self) -> tuple[Floats, Floats, Floats]:
        return self.drive.matrices(self.nominal)

    def balance(self) -> Floats:
        """The diagonal d (n,) of powers of two that balances A at the nominal values: D^-1 A D."""
        return self._balance.copy()

    @cached_property
    def _balance(self) -> Floats:
        return balance_of(self._at_nominal[0])

    def _size(self, name: str) -> float:
        return self.scales.get(name, abs(value_of(self.nominal, name)))

    def _limits(self, name: str) -> tuple[float, float]:
        if name in self.bounds:
            return self.bounds[name]
        size, value = self._size(name), value_of(self.nominal, name)
        if not self.drive.parameter(name).positive:
            return value - 10 * size, value + 10 * size
        return 0.1 * value, 10 * value


def _check_value(name: str, value: float, p: Parameter) -> None:
    if not math.isfinite(value) or (p.positive and value <= 0):
        need = "finite and greater than zero" if p.positive else "finite"
        raise NominalValueError(name, value, f"{p.meaning} must be {need}")
