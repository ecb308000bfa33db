"""The structure of a drive: named parameters with units, and A, B, C as sums of Laurent terms.

x' = A(theta) x + B(theta) u,      y = C(theta) x
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

import numpy as np

from monitor_core.arrays import Bools, Floats
from monitor_core.drive.parameter_names import slope_name, split_name
from monitor_core.kernel.tables import OF_ANGLE, OF_MOTION, ONE, TORQUE, WEIGHT

Matrix = Literal["A", "B", "C", "rest", "ratio"]
"""A matrix of the drive; "rest" and "ratio": see ``Drive``."""
Output = Literal["speed", "angle", "mean speed"]
"""The measured output; "mean speed" is the mean over the interval before the sample."""
OUTPUT_UNITS: Mapping[Output, str] = MappingProxyType({"speed": "rad/s", "mean speed": "rad/s", "angle": "rad"})
Powers = tuple[tuple[str, int], ...]
"""Names of parameters and their exponents."""

DISTURBANCE = "torque disturbance"
"""Name of the state of a drive's torque disturbance."""
DISTURBANCE_TIME = "Td"
"""Name of the time constant of a drive's torque disturbance."""
_DISTURBANCE = "time constant of the torque disturbance"
INERTIA, DAMPING, STIFFNESS, TORQUE_UNIT = "kg m^2", "N m s/rad", "N m/rad", "N m"
"""Units of inertias, dampers, springs and torques."""
SINCE_SAMPLE = "angle since the last sample"
"""Name of the state that gives a mean speed."""
DELAY = "delay"
"""Name of the delay between torque and output."""
_DELAYED = "delay of the torque after its sample"

LOAD = "load"
"""Name of the ratio of the weight that loads an axis to the nominal weight."""
_LOAD = "weight of arm and payload, relative to nominal"


@dataclass(frozen=True, slots=True)
class Parameter:
    """A physical parameter: its name, its SI unit as text, and its meaning in words.

    ``positive``: the value must be above zero (inertias, springs).  ``nonnegative``: the value must not be negative
    (dampers, friction); this is implied by ``positive``.
    """

    name: str
    unit: str
    meaning: str
    positive: bool = True
    nonnegative: bool = False

    @property
    def least(self) -> float:
        """Physical lower bound: 0, or minus infinity."""
        return 0.0 if self.positive or self.nonnegative else -math.inf


@dataclass(frozen=True, slots=True)
class MatrixTerm:
    """``coefficient * prod parameter^exponent``, added to one entry of a matrix."""

    matrix: Matrix
    row: int
    col: int
    coefficient: float
    powers: Powers

    def value(self, values: Mapping[str, float]) -> float:
        """The term at the given parameter values; complex values pass through."""
        return _product(self.coefficient, self.powers, values)


@dataclass(frozen=True, slots=True)
class Definition:
    """``name`` = sum of ``coefficient * prod value^exponent``, of drawn parameters and names defined before it."""

    name: str
    terms: tuple[tuple[float, Powers], ...]

    @property
    def names(self) -> frozenset[str]:
        """Names of the values in the definition."""
        return frozenset(name for _, powers in self.terms for name, _ in powers)

    def value(self, values: Mapping[str, float]) -> float:
        """Value of the definition.

        Raises:
            ValueError: a division by zero, or a number that is too large.
        """
        try:
            return sum(_product(coefficient, powers, values) for coefficient, powers in self.terms)
        except ArithmeticError:
            parts = ", ".join(f"{name} = {values[name]}" for name in sorted(self.names))
            raise ValueError(f"{self.name} has no finite value at {parts}") from None


@dataclass(frozen=True, slots=True)
class Quantity:
    """Name and unit of a state or an input."""

    name: str
    unit: str


@dataclass(frozen=True)
class Drive:
    """The structure of a drive.

    Terms of the matrix "rest" (n, 1) are the state of the drive that moves rigidly with output 1: a predictor starts
    from it after a gap.  Those of "ratio" (m, 1) are, for each input that depends on the motion, the angle at its
    flange while the angle at the sensor is 1; an input without such a term is at the sensor (1).
    """

    name: str
    output: Output
    states: tuple[Quantity, ...]
    """n of them"""
    inputs: tuple[int, ...]
    """m kinds from monitor_core.kernel.tables (TORQUE, COULOMB, ..)"""
    parameters: tuple[Parameter, ...]
    """Those that occur in the terms"""
    terms: tuple[MatrixTerm, ...]
    speed_state: int
    """The state that is the speed at the sensor up to a factor, -1 if there is none; only Coulomb friction with the
    angle as output needs it"""
    definitions: tuple[Definition, ...] = ()
    """Of parameters that are merged from those of the user, in order: ``Jm + r^2*Jg`` for inertias that are rigidly
    joined"""
    drawn: tuple[Parameter, ...] = ()
    """All parameters of the user, if some are merged"""

    def parameter(self, name: str) -> Parameter:
        """The parameter with this name, which may be ``1/name``.

        Raises:
            KeyError: the drive has no such parameter, or has it only as a part of others.
        """
        base, inverse = split_name(name)
        for candidate in self.parameters:
            if candidate.name == base:
                return _inverted(candidate, name) if inverse else candidate
        raise KeyError(self._why_not(base))

    def given_as(self, name: str) -> Parameter:
        """The parameter whose value may be given under this name: a parameter of the drive, or a drawn one.

        Raises:
            KeyError: there is no such parameter.
        """
        for candidate in (*self.parameters, *self.drawn):
            if candidate.name == name:
                return candidate
        raise KeyError(self._why_not(name))

    def complete(self, values: Mapping[str, float]) -> dict[str, float]:
        """The values of all parameters; merged ones that are not given are computed from the drawn ones.

        Raises:
            KeyError: a value is missing.
            ValueError: a merged parameter has no value.
        """
        known = dict(values)
        for definition in self.definitions:
            if definition.name not in known and definition.names <= known.keys():
                known[definition.name] = definition.value(known)
        for p in self.parameters:
            if p.name not in known:
                raise KeyError(self._missing(p, known))
        return {p.name: known[p.name] for p in self.parameters}

    def merged_from(self, name: str) -> tuple[str, ...]:
        """The parameters that are merged from the parameter with this name and others."""
        parts = {name}
        for definition in self.definitions:
            if not parts.isdisjoint(definition.names):
                parts.add(definition.name)
        return tuple(p.name for p in self.parameters if p.name in parts - {name})

    def matrix(self, which: Matrix, values: Mapping[str, float]) -> Floats:
        """A (n, n), B (n, m), C (1, n), rest (n, 1) or ratio (m, 1) at the given values of all parameters."""
        n, m = len(self.states), len(self.inputs)
        shape = {"A": (n, n), "B": (n, m), "C": (1, n), "rest": (n, 1), "ratio": (m, 1)}[which]
        kind = complex if any(isinstance(v, complex) for v in values.values()) else float
        out = np.zeros(shape, dtype=kind)
        if which == "ratio":
            stated = {term.row for term in self.terms if term.matrix == which}
            at_sensor = [c for c, kind in enumerate(self.inputs) if kind in OF_MOTION and c not in stated]
            out[at_sensor] = 1.0
        for term in self.terms:
            if term.matrix == which:
                out[term.row, term.col] += term.value(values)
        return out

    def matrices(self, values: Mapping[str, float]) -> tuple[Floats, Floats, Floats]:
        """A (n, n), B (n, m) and C (1, n) at the given values of all parameters."""
        return self.matrix("A", values), self.matrix("B", values), self.matrix("C", values)

    # --- What acts, and on what ---------------------------------------------------------------------------------------

    def acting(self, values: Mapping[str, float], free: Collection[str] = ()) -> Bools:
        """Mask (m,) of the inputs that act at the given values of all parameters; ``free`` ones count as not zero."""
        bases = {split_name(name)[0] for name in free}
        at = {name: value or float(name in bases) for name, value in values.items()}
        return np.asarray(self.matrix("B", at).any(axis=0), np.bool_)

    def acts(self, kinds: Sequence[int], values: Mapping[str, float], free: Collection[str] = ()) -> bool:
        """Whether an input of these kinds acts; arguments as of ``acting``."""
        return bool((np.isin(self.inputs, kinds) & self.acting(values, free)).any())

    @property
    def of_torque(self) -> Bools:
        """Mask (m,) of the inputs that are the motor torque."""
        return np.array([kind == TORQUE for kind in self.inputs])

    def constant_torques(self) -> tuple[str, ...]:
        """Parameters that are factors of a constant input and of nothing else, such as a torque offset."""
        return tuple(p.name for p in self.parameters if self._drives_only(p.name, (ONE,)))

    def weights(self) -> tuple[str, ...]:
        """Parameters that are factors of the weight, which turns with the pose, and of nothing else."""
        return tuple(p.name for p in self.parameters if self._drives_only(p.name, (*OF_ANGLE, WEIGHT)))

    def _drives_only(self, name: str, kinds: Sequence[int]) -> bool:
        found = [(term, power) for term in self.terms for factor, power in term.powers if factor == name]
        return bool(found) and all(
            term.matrix == "B" and self.inputs[term.col] in kinds and power == 1 for term, power in found
        )

    @property
    def mean_state(self) -> int:
        """Index of the state that is reset to zero after every sample; -1: there is none."""
        if self.output != "mean speed":
            return -1
        return next((k for k, state in enumerate(self.states) if state.name == SINCE_SAMPLE), -1)

    # --- The same drive with more -------------------------------------------------------------------------------------

    def with_delay(self) -> Drive:
        """The drive with the delay of its torque as a parameter that can be monitored; the matrices do not contain it.

        Raises:
            ValueError: the drive has a parameter of that name already.
        """
        return replace(self, parameters=self._parameters_and(Parameter(DELAY, "s", _DELAYED, positive=False)))

    def with_load(self, offset: str) -> Drive:
        """The drive with the torque of the nominal weight as one more input, multiplied by the parameter ``load``.

        It acts at the same place and has the same unit as the constant torque ``offset``.

        Raises:
            ValueError: ``offset`` is not a constant torque, or the drive already has a parameter ``load``.
        """
        return self._with_torque(offset, Parameter(LOAD, "1", _LOAD))

    def with_torque_of(self, offset: str, signal: str) -> Drive:
        """The drive with a signal as one more input, which acts at the same place as the constant torque ``offset``.

        Its parameter is the slope, "tau0 per cos(axis2)", in the unit of that torque per unit of the signal.

        Raises:
            ValueError: as in ``with_load``.
        """
        unit = self.parameter(offset).unit
        return self._with_torque(offset, Parameter(slope_name(offset, signal), unit, "slope", positive=False))

    def _with_torque(self, offset: str, factor: Parameter) -> Drive:
        if offset not in self.constant_torques():
            raise ValueError(f"the drive {self.name!r} has no constant torque {offset}")
        acts = [
            replace(
                t,
                col=len(self.inputs),
                powers=tuple((factor.name if n == offset else n, e) for n, e in t.powers),
            )
            for t in self.terms
            if offset in dict(t.powers)
        ]
        return replace(
            self, inputs=(*self.inputs, WEIGHT), parameters=self._parameters_and(factor), terms=(*self.terms, *acts)
        )

    def with_mean_speed(self) -> Drive:
        """The drive with a sensor that gives the mean speed over each interval h:  s' = C x,  y = s / h.

        C is that of the speed.  s, the last state, is reset to zero after every sample; the factor 1/h is not in C.

        Raises:
            ValueError: the output of this drive is not the speed.
        """
        if self.output != "speed":
            raise ValueError(f"the drive {self.name!r} has the {self.output} as output: its mean is that of a speed")
        n = len(self.states)
        turned = [replace(term, matrix="A", row=n) for term in self.terms if term.matrix == "C"]
        others = [term for term in self.terms if term.matrix != "C"]
        return replace(
            self,
            output="mean speed",
            states=(*self.states, Quantity(SINCE_SAMPLE, "rad")),
            terms=(*others, *turned, MatrixTerm("C", 0, n, 1.0, ())),
        )

    def with_disturbance(self) -> Drive:
        """The drive with a torque disturbance d as last state:  d' = -d / Td + w,  N m; w is no input.

        Raises:
            ValueError: the drive has a parameter Td already.
        """
        n = len(self.states)
        torque = [t for t in self.terms if t.matrix == "B" and self.inputs[t.col] == TORQUE]
        acts = [replace(term, matrix="A", col=n) for term in torque]
        decays = MatrixTerm("A", n, n, -1.0, ((DISTURBANCE_TIME, -1),))
        return replace(
            self,
            states=(*self.states, Quantity(DISTURBANCE, "N m")),
            parameters=self._parameters_and(Parameter(DISTURBANCE_TIME, "s", _DISTURBANCE)),
            terms=(*self.terms, *acts, decays),
        )

    def _parameters_and(self, more: Parameter) -> tuple[Parameter, ...]:
        if any(p.name == more.name for p in (*self.parameters, *self.drawn)):
            raise ValueError(f"the drive {self.name!r} already has a parameter {more.name}")
        return (*self.parameters, more)

    # --- Messages -----------------------------------------------------------------------------------------------------

    def _why_not(self, name: str) -> str:
        if name in {p.name for p in self.drawn}:
            merged = self.merged_from(name)
            if merged:
                return f"{name} occurs only in {' and in '.join(merged)}: monitor that"
            return f"{name} has no effect on what is measured in the drive {self.name!r}"
        known = ", ".join(p.name for p in self.parameters)
        return f"the drive {self.name!r} has no parameter {name!r}; it has {known}"

    def _missing(self, p: Parameter, known: Mapping[str, float]) -> str:
        """Message on a missing value; for a merged parameter, it names the first drawn one without a value."""
        name = next(self._lacking(p.name, known), p.name)
        if name == p.name:
            return f"no nominal value for {p.name} ({p.meaning}, {p.unit})"
        part = self.given_as(name)
        return f"no nominal value for {name} ({part.meaning}, {part.unit}), which {p.name} is made of"

    def _lacking(self, name: str, known: Mapping[str, float]) -> Iterator[str]:
        for definition in self.definitions:
            if definition.name == name:
                for part in sorted(definition.names - known.keys()):
                    yield from self._lacking(part, known)
                return
        yield name


def _inverted(p: Parameter, name: str) -> Parameter:
    unit = "1" if p.unit == "1" else f"1/({p.unit})"
    return replace(p, name=name, unit=unit, meaning=f"reciprocal of: {p.meaning}")


def _product(coefficient: float, powers: Powers, values: Mapping[str, float]) -> float:
    return coefficient * math.prod(values[name] ** e for name, e in powers)
