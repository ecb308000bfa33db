"""An identification problem: a drive, its free parameters, and the predictor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.parameter_names import slope_name, split_name
from monitor_core.drive.structure import Drive

PredictorKind = Literal["output-error", "innovations"]
Loss = Literal["squares", "huber"]
MotionSource = Literal["measured", "simulated"]
Initial = Literal["free", "first"]
Level = Literal["torque", "slow", "time_constant"]

RELATIVE = ("kT", "r")
"""Torque constant and gear ratio, which are known from data sheets and are held unless the user frees them"""


@dataclass(frozen=True)
class Disturbance:
    """Noise that acts on the drive besides the motor torque; the gain K of the innovations form follows from it.

    Standard deviations; only their ratios to that of the output affect K, so that one is never free.  Those of ``free``
    are start values and are estimated with theta.

    Args:
        torque: of white noise that enters like the torque, held over each interval, N m; None: chosen by trial, and
            ``slow``, unless 0, starts from the same value.
        slow: of d, N m, where d' = -d / time_constant_s + w enters like the torque, too; 0: no such state.
        time_constant_s: of d.
        output: of the white noise on the output, rad/s or rad.
        free: which of "torque", "slow" and "time_constant" are estimated; one that is 0 never is.

    Raises:
        ValueError: a value out of its range.
    """

    torque: float | None = None
    slow: float = 0.0
    time_constant_s: float = 1.0
    output: float = 1.0
    free: tuple[Level, ...] = ("torque", "slow")

    def __post_init__(self) -> None:
        for name, value in {"torque": self.torque or 0.0, "slow": self.slow}.items():
            if not 0 <= value < math.inf:
                raise ValueError(f"{name} = {value}: need a finite value, at least zero")
        for name, value in {"time_constant_s": self.time_constant_s, "output": self.output}.items():
            if not 0 < value < math.inf:
                raise ValueError(f"{name} = {value}: need a finite value greater than zero")
        if unknown := set(self.free) - {"torque", "slow", "time_constant"}:
            raise ValueError(f"free = {sorted(unknown)}: a noise level is torque, slow or time_constant")


@dataclass(frozen=True)
class Problem:
    """A grey-box model with free parameters.

    Args:
        drive: its structure.
        nominal: values of all parameters, as AxisModel takes them; those of the free ones are the start.
        free: names of the drive's parameters to be estimated, "1/Ja" for the reciprocal of Ja.  Positive ones are
            estimated as logarithms, and so stay positive.
        predictor: "output-error" simulates; "innovations" corrects the state by K eps at each sample, which is needed
            for unbiased estimates from noisy records in closed loop.
        speed_scale: of Coulomb friction, rad/s, as in Settings.
        delay_s: delay from the torque sample until the torque acts.  A delay within one interval is exact for any
            intervals, and the monitor uses the same value; delays of whole intervals, or a negative one, need records
            without jitter.
        free_delay: whether the delay is estimated.
        disturbance: noise from which K follows; None: white torque noise of unknown level.
        K: fixed filter gain (n,) in the drive's states; then there is no disturbance.
        loss: "huber" for records with outliers.
        bounds: bounds of free parameters, by name, including "delay".  The default excludes impossible values: negative
            inertias, springs, dampers and friction.
        motion: what Coulomb friction and gravity depend on: "measured", as in the monitor (with the angle as output
            friction there follows the speed of the predictor), or "simulated": all on the predictor's state.
        initial: state at the first sample: "free", or "first": moving rigidly with the first output, noise and all,
            as the monitor starts.
        varying: parameters that are not constant, theta(t) = theta + sum_j b_j s_j(t), each with the names of the
            records' signals s_j; the b_j are estimated.
        slopes: where the b_j start, by name, "fm per temperature"; 0 if not given.
        interval_s: that K belongs to, s; None: the median interval of the records.
        min_speed: errors count only while the axis has at least this speed, as in the monitor, rad/s at the sensor; the
            state is corrected at all speeds.  0: all errors count.

    Raises:
        KeyError, ValueError: what AxisModel refuses; settings that contradict one another.
    """

    drive: Drive
    nominal: Mapping[str, float]
    free: tuple[str, ...]
    predictor: PredictorKind = "innovations"
    speed_scale: float = 1.0
    delay_s: float = 0.0
    free_delay: bool = False
    disturbance: Disturbance | None = None
    K: tuple[float, ...] | None = None
    loss: Loss = "squares"
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    motion: MotionSource = "measured"
    initial: Initial = "free"
    varying: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    slopes: Mapping[str, float] = field(default_factory=dict)
    interval_s: float | None = None
    min_speed: float = 0.0

    def __post_init__(self) -> None:
        # Monitoring none of them: a free parameter that starts at zero needs no scale, the data set it.
        object.__setattr__(self, "nominal", AxisModel(self.drive, self.nominal, ()).nominal)
        self._check_free()
        if self.predictor == "output-error" and (self.disturbance or self.K):
            raise ValueError("an output-error predictor has no gain: leave out disturbance and K")
        if self.disturbance and self.K:
            raise ValueError("K is either given or follows from the disturbance: give one of them")
        if self.K is not None and len(self.K) != len(self.drive.states):
            raise ValueError(f"K has {len(self.K)} entries, the drive {len(self.drive.states)} states")
        if not 0 < self.speed_scale < math.inf:
            raise ValueError(f"speed_scale = {self.speed_scale}: need a finite value greater than zero")
        if not math.isfinite(self.delay_s):
            raise ValueError(f"delay_s = {self.delay_s}: need a finite value")

    def _check_free(self) -> None:
        bases = [split_name(name)[0] for name in self.free]
        for name, base in zip(self.free, bases, strict=True):
            self.drive.parameter(name)
            if bases.count(base) > 1:
                raise ValueError(f"{base} is free twice")
            if name != base and self.nominal[base] == 0:
                raise ValueError(f"{name} does not exist: its nominal value is 0")
        for name in self.varying:
            if name not in self.free:
                raise ValueError(f"{name} depends on signals and so must be free")
        for name, (lower, upper) in self.bounds.items():
            if not lower < upper:
                raise ValueError(f"bounds of {name} = {lower}, {upper}: the first must be below the second")

    @property
    def followed_torques(self) -> tuple[tuple[str, str], ...]:
        """Constant torques that follow signals, each with one signal."""
        constant = self.drive.constant_torques()
        return tuple((name, s) for name, signals in self.varying.items() if name in constant for s in signals)

    def with_torque_inputs(self) -> Problem:
        """The problem with these torques as inputs of the drive: exact, and linear in the slopes."""
        torques = self.followed_torques
        if not torques:
            return self
        drive, nominal, free = self.drive, dict(self.nominal), list(self.free)
        for name, signal in torques:
            drive, slope = drive.with_torque_of(name, signal), slope_name(name, signal)
            nominal[slope] = self.slopes.get(slope, 0.0)
            free.append(slope)
        followed = {name for name, _ in torques}
        varying = {name: signals for name, signals in self.varying.items() if name not in followed}
        return replace(self, drive=drive, nominal=nominal, free=tuple(free), varying=varying)


# --- The error for causes that the user can correct -------------------------------------------------------------------


class IdentificationError(Exception):
    """The identification is not possible in this way; the text says why, with numbers."""
