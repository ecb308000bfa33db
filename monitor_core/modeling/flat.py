"""The flat form of a drive: variables and linear equations, before the elimination.

Drawings (drawing.py) and Modelica texts (modelica/) both end here; elimination/ starts here.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from monitor_core.modeling.laurent import Laurent

CONSTANT = "1"
"""The name of the input that is always one: constant terms of equations are its coefficients."""


@dataclass(frozen=True, slots=True)
class Origin:
    """Origin of an item: a component ("" is the whole model), a file ("" if there is none), a line."""

    component: str = ""
    file: str = ""
    line: int = 0

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}" if self.line else self.file
        return ": ".join(part for part in (place, self.component) if part)


class ModelError(Exception):
    """The drive is not a valid model; the text names file, line and component, and says what would be right."""

    def __init__(self, problem: str, origin: Origin | None = None) -> None:
        self.problem, self.origin = problem, origin or Origin()
        place = str(self.origin)
        super().__init__(f"{place}: {problem}" if place else problem)


@dataclass(frozen=True, slots=True)
class FlatParameter:
    """A parameter that the user named or drew.

    ``unit``: in the form of units.py ("kg m^2"); "": unknown.  ``value``: nominal value, if the drawing gives one.
    ``positive``: the value must be above zero.  ``nonnegative``: the value must not be negative.
    """

    name: str
    unit: str
    meaning: str = ""
    value: float | None = None
    positive: bool = False
    nonnegative: bool = False
    origin: Origin = field(default_factory=Origin)


@dataclass(frozen=True, slots=True)
class FlatVariable:
    """An unknown.  ``unit``: "rad", "rad/s", "rad/s^2", "N m", or "" for a signal of unknown unit.

    ``prefer``: a good coordinate (the angle of an inertia).  ``relative``: the deflection of a spring or damper.
    """

    name: str
    unit: str
    prefer: bool = False
    relative: bool = False
    origin: Origin = field(default_factory=Origin)


@dataclass(frozen=True, slots=True)
class FlatInput:
    """A known signal.

    ``kind``: as in monitor_core.kernel.tables.  ``angle``: variable that an input of the motion depends on (Coulomb
    friction depends on its derivative, gravity on the angle itself), otherwise "".
    """

    name: str
    kind: int
    angle: str = ""
    origin: Origin = field(default_factory=Origin)


@dataclass(frozen=True, slots=True)
class FlatSensor:
    """A sensor: the angle of its flange, and whether it was drawn as "speed" or "angle"."""

    name: str
    angle: str
    quantity: str
    origin: Origin = field(default_factory=Origin)


Symbol = tuple[str, int]
"""A variable or an input, and how many times it is differentiated."""


@dataclass(frozen=True, slots=True)
class FlatEquation:
    """sum of coefficient * d^k variable / dt^k = 0, inputs and CONSTANT among the variables (with k = 0)."""

    terms: Mapping[Symbol, Laurent]
    origin: Origin = field(default_factory=Origin)


@dataclass(frozen=True, slots=True)
class FlatComponent:
    """A component as it was drawn, for a picture of the drive; its equations are part of the model.

    ``nodes``: where its flanges are; components at one node are connected there.  ``parameters`` by role.
    """

    name: str
    kind: str
    nodes: tuple[str, ...]
    parameters: Mapping[str, Laurent]


@dataclass(frozen=True, slots=True)
class FlatModel:
    """All variables and equations of a drive.  Every variable of every equation is in ``variables`` or ``inputs``."""

    name: str
    parameters: tuple[FlatParameter, ...]
    variables: tuple[FlatVariable, ...]
    inputs: tuple[FlatInput, ...]
    sensors: tuple[FlatSensor, ...]
    equations: tuple[FlatEquation, ...]
    components: tuple[FlatComponent, ...] = ()
    origin: Origin = field(default_factory=Origin)
