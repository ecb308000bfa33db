"""A hypothesis: a cause, a size, and their effect on the model, the torque and the output."""

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.samples import forward_fill

_NOTHING: Mapping[str, float] = MappingProxyType({})

HEALTHY = ""
"""The cause of the hypothesis that nothing has changed from the present state"""


@dataclass(frozen=True, slots=True)
class Distortion:
    """Error of a measured signal:  scale * true value + offset."""

    scale: float = 1.0
    offset: float = 0.0

    def after(self, before: "Distortion") -> "Distortion":
        """The composition of both distortions, ``before`` first."""
        return Distortion(self.scale * before.scale, self.scale * before.offset + self.offset)


_UNDISTORTED = Distortion()


@dataclass(frozen=True)
class Hypothesis:
    """One possible change of the axis.

    ``size`` orders the hypotheses of a cause: the logarithm of a factor, or a difference in units of a scale; NaN if
    the cause has no size.  ``is_gain``: the size is the logarithm of a factor, and the effect is proportional to the
    factor minus one.  ``factors`` and ``shifts``: changes of the parameters of the drive, by name.  ``torque`` turns
    the measured torque into the acting one, and ``delay_s`` is its additional delay.  ``output`` turns the true output
    into the measured one.  ``frozen``: the measured output repeats itself in every digit.  ``still``: the hypothesis
    holds only while the measured torque repeats itself.  ``K``: filter gain of the hypothesis; None: that of the
    settings.  ``variance``: its innovation variance over lambda_0.  ``weight``: its prior weight.  ``alike``: other
    causes that produce the same data.

    Raises:
        ValueError: a number is not finite, or not positive where it must be.
    """

    cause: str
    size: float = math.nan
    factors: Mapping[str, float] = field(default_factory=lambda: _NOTHING)
    shifts: Mapping[str, float] = field(default_factory=lambda: _NOTHING)
    torque: Distortion = _UNDISTORTED
    delay_s: float = 0.0
    output: Distortion = _UNDISTORTED
    frozen: bool = False
    still: bool = False
    K: tuple[float, ...] | None = None
    variance: float = 1.0
    weight: float = 1.0
    alike: tuple[str, ...] = ()
    is_gain: bool = False

    def __post_init__(self) -> None:
        numbers = [self.torque.scale, self.torque.offset, self.delay_s, self.output.offset, *(self.K or ())]
        numbers += [*self.factors.values(), *self.shifts.values()]
        positive = [self.variance, self.weight, abs(self.output.scale)]
        if not (all(map(math.isfinite, numbers + positive)) and min(positive) > 0):
            raise ValueError(f"a hypothesis of {self.cause!r} with numbers that are not finite, or not positive")

    @property
    def has_steps(self) -> bool:
        """Whether there are hypotheses of other sizes around this one."""
        return self.K is None and not math.isnan(self.size)

    def after(self, base: "Hypothesis") -> "Hypothesis":
        """This change in addition to ``base``."""
        factors = {n: self.factors.get(n, 1.0) * base.factors.get(n, 1.0) for n in {**base.factors, **self.factors}}
        shifts = {n: self.shifts.get(n, 0.0) + base.shifts.get(n, 0.0) for n in {**base.shifts, **self.shifts}}
        return Hypothesis(
            cause=self.cause,
            size=self.size,
            factors=factors,
            shifts=shifts,
            torque=self.torque.after(base.torque),
            delay_s=self.delay_s + base.delay_s,
            output=self.output.after(base.output),
            frozen=self.frozen or base.frozen,
            still=self.still,
            K=base.K if self.K is None else self.K,
            variance=self.variance * base.variance,
            weight=self.weight,
            alike=self.alike,
            is_gain=self.is_gain,
        )


REFERENCE = Hypothesis(HEALTHY)
"""The hypothesis that nothing has changed"""


# --- Variable nominal values: hypotheses follow them in steps, as their predictors have fixed values in between -------


STEP = 0.01
"""One step, as a share of a parameter's scale: a hypothesis is off by at most a tenth of the smallest size."""


def steps(
    model: AxisModel, shift: Floats | None, before: tuple[int, ...], N: int
) -> Iterator[tuple[slice, tuple[int, ...]]]:
    """Split N samples where a nominal value moves by a step: yields each slice with the position (p,) in steps.

    ``shift`` (N, p): theta_0(s) - theta_0, NaN where it is unknown; None: unchanged.  ``before``: position at the
    sample before.
    """
    if shift is None:
        yield slice(0, N), before
        return
    moved = forward_fill(np.round(shift / (STEP * model.scale)), np.array(before, float)).astype(int)
    edges = [0, *(np.flatnonzero((np.diff(moved, axis=0) != 0).any(axis=1)) + 1).tolist(), N]
    for start, end in itertools.pairwise(edges):
        if start < end:
            yield slice(start, end), tuple(moved[start].tolist())


def moved_model(model: AxisModel, moved: tuple[int, ...]) -> AxisModel:
    """The model with nominal values moved by these steps, within the bounds of theta; it monitors nothing."""
    if not any(moved):
        return model
    theta = model.theta0 + STEP * model.scale * np.array(moved)
    values = model.values(np.clip(theta, *model.limits))
    return replace(model, nominal=values, monitored=(), scales={}, bounds={})
