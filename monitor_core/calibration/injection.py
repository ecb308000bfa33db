"""Injection of faults into a healthy record: exactly, if the same motion would only have needed another torque.

The motor torque enters the drive by a vector b: x' = A x + b u + ...  A fault may change A, and the columns of the
other inputs, by -b times a measured quantity (friction of the motor: its speed), or b itself by a factor (the torque
constant).  Such a fault leaves the motion unchanged if the torque is  u' = (u + load) / factor.  The effect of other
faults on the output is simulated with the identified model.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.calibration.simulated_copies import Innovations, Plants, innovations
from monitor_core.calibration.surrogate_records import CHUNK
from monitor_core.drive.assembly import Assembly
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import DELAY
from monitor_core.kernel.tables import ANGLE_FUNCTIONS, COULOMB, ONE, TORQUE, WEIGHT
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings

_SAME = 1e-9


@dataclass(frozen=True)
class InjectedFault:
    """A change of a monitored parameter, as a share of its size."""

    parameter: str
    size: float


@dataclass(frozen=True)
class EquivalentLoad:
    """u' = (u + viscous * speed + sum of coefficient * input) / factor, in N m at the motor."""

    factor: float
    viscous: float
    inputs: Mapping[int, float]
    """Coefficients of further inputs, by index of the input"""


def changed_values(model: AxisModel, name: str, change: float) -> dict[str, float]:
    """Parameter values with one monitored parameter changed by a share of its size.

    Raises:
        ValueError: it would leave its bounds.
    """
    i = model.monitored.index(name)
    theta = model.theta0.copy()
    theta[i] += change * model.scale[i]
    lower, upper = model.limits[:, i]
    if not lower <= theta[i] <= upper:
        raise ValueError(f"{name} would leave its bounds")
    return model.values(theta)


def inject(
    axis: MonitoredAxis, record: SampleBlock, faults: Sequence[InjectedFault], at: Ints, N: int
) -> Iterator[tuple[InjectedFault, EquivalentLoad | None, Floats, Floats | None]]:
    """Each fault, injected into the record.

    Yields for each fault its equivalent load if that is known exactly, with the torque of the whole record and no
    outputs; otherwise no load, the recorded torque, and the outputs (N, onsets) from each onset on.
    """
    before = innovations(axis, record, at.tolist())
    for fault in faults:
        values = changed_values(axis.model, fault.parameter, fault.size)
        load = equivalent_load(axis.model, values)
        if load is not None:
            yield fault, load, faulty_torque(axis, record, load), None
        else:
            plants = Plants(axis, [axis.model.nominal, values])
            yield fault, None, record.u, _faulty_outputs(plants, record, at, N, before)


def _faulty_outputs(plants: Plants, record: SampleBlock, at: Ints, N: int, before: Innovations) -> Floats:
    """Outputs (N, onsets) of the record, changed by the difference that the model predicts for the fault.

    The first of the plants is healthy, the second faulty.
    """
    healthy, u_before = np.zeros(len(at), np.int64), record.u[at - 1]
    # Until the onset the previous torque acts, on the healthy drive.
    older, nothing = record.u[np.maximum(at - 2, 0)], np.zeros((1, len(at)))
    _, x = plants.run(healthy, before.x, older, u_before[np.newaxis], nothing)
    out, x_faulty = np.empty((N, len(at))), x
    for first in range(0, N, CHUNK):
        rows = np.arange(first, min(first + CHUNK, N))[:, np.newaxis] + at
        u, e = record.u[rows], np.nan_to_num(before.eps[rows])
        weight = None if record.weight is None else record.weight[rows]
        without, x = plants.run(healthy, x, u_before, u, e, weight)
        with_fault, x_faulty = plants.run(healthy + 1, x_faulty, u_before, u, e, weight)
        out[first : first + CHUNK] = record.y[rows] + with_fault - without
        u_before = u[-1]
    return out


def equivalent_load(model: AxisModel, values: Mapping[str, float]) -> EquivalentLoad | None:
    """Change of the torque that gives the same motion with these values; None: there is no exact one."""
    if values.get(DELAY, 0.0) != model.nominal.get(DELAY, 0.0):
        return None
    drive = model.drive
    (A, B, C), (A1, B1, C1) = model.matrices(), drive.matrices(values)
    faulty_torque = drive.inputs.index(TORQUE)
    b, size = B[:, faulty_torque], float(np.abs(B[:, faulty_torque]).max())
    speed = C[0] if drive.output == "speed" else (C @ A)[0]
    factor = _share(B1[:, faulty_torque], b)
    viscous = _outer(A1 - A, b, speed)
    loads = {c: _share(B[:, c] - B1[:, c], b) for c in range(len(drive.inputs)) if c != faulty_torque}
    if size == 0 or factor is None or viscous is None or None in loads.values() or not np.array_equal(C, C1):
        return None
    return EquivalentLoad(factor, viscous, {c: v for c, v in loads.items() if v})


def _share(change: Floats, b: Floats) -> float | None:
    """The factor with which b gives the vector ``change``; None: there is none."""
    share = float(change @ b / (b @ b))
    same = np.allclose(change, share * b, rtol=_SAME, atol=_SAME * np.abs(change).max(initial=0.0))
    return share if same else None


def _outer(change: Floats, b: Floats, speed: Floats) -> float | None:
    """v with change = -v b speed'; None: there is none."""
    shape = np.outer(b, speed)
    v = float(-(change * shape).sum() / (shape * shape).sum())
    fits = np.allclose(change, -v * shape, rtol=1e-6, atol=_SAME * max(1e-300, np.abs(change).max()))
    return v if fits else None


def faulty_torque(axis: MonitoredAxis, record: SampleBlock, load: EquivalentLoad) -> Floats:
    """Torque u' (N,) that the motion of the record would have needed.

    A load acts with its mean over the interval in which the torque is held.
    """
    model, settings = axis
    u_scale = Assembly(model.drive, model.monitored).model_constants(model, settings.speed_scale)["u_scale"]
    needed, speed = record.u.copy(), _mean_speed(axis, record)
    if load.viscous:
        needed += load.viscous * _with_delay(speed, settings)
    for c, coefficient in load.inputs.items():
        needed += coefficient * _with_delay(_input(axis, record, c, u_scale[c], speed), settings)
    return np.asarray(needed / load.factor)


def _input(axis: MonitoredAxis, record: SampleBlock, c: int, scale: float, speed: Floats) -> Floats:
    """Mean of input c, not the torque, over the interval that begins with each sample (N,)."""
    model, settings = axis
    kind, output = model.drive.inputs[c], model.drive.output
    if kind == ONE:
        return np.ones(len(record.u))
    if kind == WEIGHT:
        return np.zeros(len(record.u)) if record.weight is None else np.nan_to_num(record.weight)
    if kind == COULOMB:
        ratio = float(model.drive.matrix("ratio", model.nominal)[c, 0]) / settings.speed_scale
        return _interval_mean(np.tanh(ratio * record.y)) if output == "speed" else np.tanh(ratio * speed)
    return _interval_mean(ANGLE_FUNCTIONS[kind](scale * record.y))


def _mean_speed(axis: MonitoredAxis, record: SampleBlock) -> Floats:
    """Mean of the speed over the interval that begins with each sample (N,)."""
    if axis.model.drive.output == "speed":
        return _interval_mean(record.y)
    after = np.append(record.y[1:], record.y[-1])
    if axis.model.drive.output == "mean speed":
        return after
    h = np.diff(record.t_us, append=record.t_us[-1] + round(axis.settings.interval_s * 1e6)) * 1e-6
    return np.asarray((after - record.y) / h)


def _interval_mean(values: Floats) -> Floats:
    return np.asarray((values + np.append(values[1:], values[-1])) / 2)


def _with_delay(mean: Floats, settings: Settings) -> Floats:
    """The mean load after the delay of the torque: a part of it acts in the next interval."""
    late = min(settings.delay_s / settings.interval_s, 1.0)
    return np.asarray((1 - late) * mean + late * np.append(mean[1:], mean[-1]))
