"""Units of causes outside the bank: nominal value and unit, and sizes of changes in them."""

import math
from typing import NamedTuple

from monitor_core.detection.multimodel.candidates import (
    OUTPUT_NOISE,
    OUTPUT_OFFSET,
    OUTPUT_SCALE,
    SENSOR_FAULTS,
    TORQUE_OFFSET,
    TORQUE_SCALE,
    unit_of,
)
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import DELAY
from monitor_core.settings import Settings

_RATIOS = (TORQUE_SCALE, OUTPUT_SCALE, OUTPUT_NOISE)
_DIFFERENCES = (TORQUE_OFFSET, OUTPUT_OFFSET, DELAY)


class Quantity(NamedTuple):
    """Nominal value of a cause, in ``unit``, and the conversion of a size of the bank to a change of it.

    ``step`` is the value of a size of 1, NaN where sizes are logarithms of factors of ``nominal``, 0 without a size.
    """

    nominal: float
    unit: str
    step: float

    def change(self, size: float, sd: float) -> tuple[float, float]:
        """Change and its standard deviation, from a size and its standard deviation in the bank."""
        if self.step == 0:
            return math.nan, math.nan
        if math.isnan(self.step):
            return self.nominal * math.expm1(size), abs(self.nominal) * math.exp(size) * sd
        return self.step * size, self.step * sd

    def size(self, change: float) -> float:
        """Size of a change; NaN where it has none, or none can be that large."""
        if self.step == 0:
            return math.nan
        if math.isnan(self.step):
            ratio = 1 + change / self.nominal
            return math.log(ratio) if ratio > 0 else math.nan
        return change / self.step


def causes_of(model: AxisModel) -> tuple[str, ...]:
    """All causes that a bank may name: the monitored parameters, and the faults of sensors."""
    return tuple(dict.fromkeys((*model.monitored, *SENSOR_FAULTS)))


def quantity_of(model: AxisModel, settings: Settings, cause: str) -> Quantity:
    """Quantity of a cause; monitored ones in the units of theta.

    Raises:
        KeyError: there is no such cause.
    """
    if cause not in causes_of(model):
        raise KeyError(cause)
    if cause in model.monitored and cause != DELAY:
        i = model.monitored.index(cause)
        step, unit = unit_of(model, settings, cause)
        own = math.nan if unit == "log" else step / float(model.unit[i])
        return Quantity(float(model.theta0[i]), model.parameters[i].unit, own)
    if cause in _RATIOS:
        return Quantity(1.0, "1", math.nan)
    if cause in _DIFFERENCES:
        step, unit = unit_of(model, settings, cause)
        late = model.nominal.get(DELAY, settings.delay_s) if cause == DELAY else 0.0
        return Quantity(late, unit, step)
    return Quantity(0.0, "1", 0.0)
