"""Predictions with a fixed theta, which may be complex."""

import numpy as np
from numpy.typing import NDArray

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import DELAY
from monitor_core.kernel.tables import TORQUE
from monitor_core.settings import Settings
from tests.core.oracle.system import LOST, Array, Interval, Matrices, held_over, inputs, with_friction


def prediction(
    model: AxisModel, s: Settings, theta: NDArray[np.generic], t_us: NDArray[np.int64], u: Array, y: Array
) -> NDArray[np.generic]:
    """yhat (N,) of the predictor with fixed theta (p,), which may be complex; a record without gaps."""
    matrices = Matrices(model)
    A, B, C = matrices.at(theta)
    K, kinds = s.gain(len(A)), np.array(model.drive.inputs)
    delay = theta[model.monitored.index(DELAY)] if DELAY in model.monitored else s.delay_s
    mean = model.drive.mean_state
    x = model.drive.matrix("rest", model.nominal)[:, 0] * y[0] + 0 * A[0]
    yhat, before = [C[0] @ x], u[0]
    for j in range(1, len(u)):
        h = (t_us[j] - t_us[j - 1]) * 1e-6
        held = inputs(model, u[j - 1], y[j - 1])
        held = with_friction(matrices, s, theta, held, y[j - 1], x, Interval(h, delay, before))
        late, ahead = (min(delay, h, key=np.real), 0.0) if np.real(delay) > 0 else (0.0, delay)
        x = x + ahead * B @ np.where(kinds == TORQUE, before - u[j - 1], 0.0)
        lost = mean >= 0 and h > LOST * s.interval_s
        own = min(h - late, s.interval_s) if lost else h - late
        for piece, torque in ((late, before), (h - late - own, u[j - 1])):
            x = held_over(A, B @ np.where(kinds == TORQUE, torque, held), x, piece)
        if lost:
            x[mean] = 0.0
        x = held_over(A, B @ np.where(kinds == TORQUE, u[j - 1], held), x, own)
        over = 1.0 if mean < 0 else own if lost else h
        yhat.append(C[0] @ x / over)
        x = x + K * (y[j] - yhat[-1])
        if mean >= 0:
            x[mean] = 0.0
        before = u[j - 1]
    return np.array(yhat)
