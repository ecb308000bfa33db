"""One more mass: the resonance that the response of a fitted drive lacks most.

With the relative errors e of a fit, their slopes J and the shape c of a further mode, all weighted, the cost falls by

    (c_' e)^2 / c_'c_,        c_ = c - J (J'J)^-1 J'c

to first order if that mode joins in: Rao's score test of its weight, over a grid of frequencies and decays.  Masses and
springs of the longer chain follow from its resonances in closed form, whatever the weight, so each candidate makes
sense.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.starting.inverse import modes_of_chain
from monitor_core.identification.starting.modal import Response
from monitor_core.identification.starting.modes import BEYOND, Modal, shape
from monitor_core.identification.starting.response import Measured
from monitor_core.identification.starting.search import errors
from monitor_core.identification.starting.slots import Slots

_GRID = 200
_RATIOS = (0.01, 0.03, 0.1)
"""Decay over frequency."""
_WEIGHTS = (0.01, 1.0)
"""Least and largest weight of a further mode, in units of the largest known."""
_MOST = 4


class Mode(NamedTuple):
    """Frequency, rad/s; weight, 1/(kg m^2); decay, 1/s; and by how much the cost would fall."""

    p: float
    a: float
    decay: float
    gain: float


def lacking(response: Response, x: Floats, measured: Measured, most: int = _MOST) -> tuple[Mode, ...]:
    """Modes that would help the fit at x (p,) most, each the best of its surroundings."""
    target = measured.target()
    e, J = (_stacked(part) for part in errors("linear", target, *response.at(x, target)))
    Q, _ = np.linalg.qr(J)
    low, high = 2 * np.pi * measured.frequency_hz[[0, -1]]
    p = np.linspace(low, BEYOND * high, _GRID)
    gains, a = np.empty((2, len(_RATIOS), p.size))
    for i, ratio in enumerate(_RATIOS):
        columns = [shape(target, w, ratio * w, measured.output) for w in p]
        c = _stacked((target.weight / target.G)[:, None] * np.array(columns).T)
        c -= Q @ (Q.T @ c)
        size = (c**2).sum(axis=0)
        a[i] = (c.T @ e) / size
        gains[i] = np.where(a[i] > 0, a[i] ** 2 * size, 0.0)
    best = gains.argmax(axis=0)
    at = np.arange(p.size)
    gain = gains[best, at]
    padded = np.concatenate([[-1.0], gain, [-1.0]])
    peaks = at[(gain > 0) & (gain >= padded[:-2]) & (gain > padded[2:])]
    chosen = peaks[np.argsort(-gain[peaks])[:most]]
    return tuple(
        Mode(float(p[k]), float(a[best[k], k]), float(_RATIOS[best[k]] * p[k]), float(gain[k]))
        for k in chosen
    )


def modes_of(slots: Slots, values: dict[str, float]) -> Modal:
    """Of a drive: frequencies and weights without its losses, decays of its own poles."""
    p, a = modes_of_chain(slots.chain(values))
    return Modal(p, a, slots.decays(values))


def joined(known: Modal, mode: Mode) -> Modal:
    """With one more."""
    low, high = (factor * known.a.max() for factor in _WEIGHTS)
    p, a = np.append(known.p, mode.p), np.append(known.a, np.clip(mode.a, low, high))
    order = np.argsort(p)
    return Modal(p[order], a[order], np.append(known.decay, mode.decay)[order])


def _stacked(values: np.ndarray) -> Floats:
    return np.concatenate([values.real, values.imag])
