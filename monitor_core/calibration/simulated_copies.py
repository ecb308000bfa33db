"""Axes simulated with the identified model and the innovations of a record, healthy and faulty."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.drive.assembly import Assembly
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.drive.structure import DELAY
from monitor_core.kernel.innovations_plant import InnovationsPlants, PlantFriction, simulate_innovations
from monitor_core.kernel.tables import COULOMB
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock

_ENDLESS = 1 - 1e-6
"""Forgetting factor with which finding P(0) takes longer than any record, so that theta stays nominal."""
_AT_ONCE = 10_000
"""Samples that are run at once: the trace of an hour would take 150 MB"""


@dataclass(frozen=True)
class Innovations:
    """Innovations eps (N,) of the predictor with nominal values along a record; NaN for samples that were not used.

    ``x`` (len(at), n): states just before the samples ``at``.
    """

    eps: Floats
    x: Floats


def innovations(axis: MonitoredAxis, record: SampleBlock, at: Sequence[int]) -> Innovations:
    """Innovations of the predictor with nominal values, and its states just before the samples ``at``, rising."""
    frozen = replace(
        axis.without_tests.settings,
        lam=_ENDLESS,
        P0=(),
        min_excitation=0.0,
        information_floor=0.0,
        outlier_limit=0.0,
    )
    monitor = AxisMonitor(axis.model, frozen)
    eps, states, done = [], [], 0
    for end in (*at, len(record.t_us)):
        for first in range(done, end, _AT_ONCE):
            part = record.select(slice(first, min(first + _AT_ONCE, end)))
            eps.append(monitor.update_traced(part)[1].eps)
        states.append(monitor.batch.state.x[:, 0].copy())
        done = end
    return Innovations(np.concatenate(eps), np.array(states[:-1]).reshape(len(at), -1))


class Plants:
    """Drives of one structure in innovations form with the gain of the monitor.

    ``values``: parameter values of each drive, including the delay of the torque if that is a parameter.
    """

    def __init__(self, axis: MonitoredAxis, values: Sequence[Mapping[str, float]]) -> None:
        model, settings = axis
        drive, h = model.drive, settings.interval_s
        assembly = Assembly(drive, model.monitored)
        matrices = [_discretised(model, value, h) for value in values]
        self._Ad, self._Bd, self._C = (np.array([matrix[k] for matrix in matrices]) for k in range(3))
        self._late = np.array([value.get(DELAY, settings.delay_s) / h for value in values])
        self._K, self._kind = settings.gain(len(drive.states)), assembly.tables.kind
        self._u_scale = assembly.model_constants(model, settings.speed_scale)["u_scale"]
        self._mean, self._friction = drive.mean_state, _friction(model, values, h)

    def run(
        self, which: Ints, x: Floats, u_before: Floats, u: Floats, eps: Floats, weight: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Simulate the drives with the indices ``which`` (W,); returns outputs y (N, W) and final states (W, n).

        Args:
            which: index of the drive of each lane.
            x: states at the first sample (W, n).
            u_before: torques of the sample before (W,).
            u: torques (N, W).
            eps: innovations (N, W).
            weight: torques of the weight (N, W); None: 0.
        """
        y, state = np.empty(u.shape), np.ascontiguousarray(x.T).copy()
        held = np.zeros(u.shape) if weight is None else np.nan_to_num(weight)
        rub = self._friction
        rub = rub._replace(half=_side_by_side(rub.half, which), braked=_side_by_side(rub.braked, which))
        Ad, Bd, C = (_side_by_side(matrices, which) for matrices in (self._Ad, self._Bd, self._C))
        plants = InnovationsPlants(Ad, Bd, C, self._K, self._kind, self._u_scale, rub, self._mean, self._late[which])
        u, eps, held = (np.ascontiguousarray(signal) for signal in (u, eps, held))
        simulate_innovations(plants, state, np.array(u_before, float), u, eps, held, y)
        return y, np.ascontiguousarray(state.T)


def _side_by_side(drives: Floats, which: Ints) -> Floats:
    """Numbers of the drive of each lane (.., W), from those of all drives (F, ..)."""
    return np.ascontiguousarray(np.moveaxis(drives[which], 0, -1))


def _friction(model: AxisModel, values: Sequence[Mapping[str, float]], h: float) -> PlantFriction:
    drive, k = model.drive, model.drive.speed_state
    unit = 0.0
    if drive.output == "speed":
        unit = float(drive.matrix("rest", model.nominal)[k, 0]) if k >= 0 else 1.0
    rows = [np.hstack([drive.matrix("A", value), drive.matrix("B", value)])[k] for value in values]
    half = (h / 2 if k >= 0 else 0.0) * np.array(rows)
    braked = half[:, len(drive.states) :] * (np.array(drive.inputs) == COULOMB)
    return PlantFriction(k, unit, half, braked)


def _discretised(model: AxisModel, values: Mapping[str, float], h: float) -> tuple[Floats, Floats, Floats]:
    drive, d = model.drive, model.balance()
    A, B, C = drive.matrices(values)
    Ad, Bd = zero_order_hold(A / d[:, np.newaxis] * d, B / d[:, np.newaxis], h)
    Ad, Bd = Ad * d[:, np.newaxis] / d, Bd * d[:, np.newaxis]
    return Ad, Bd, C[0] / h if drive.mean_state >= 0 else C[0]
