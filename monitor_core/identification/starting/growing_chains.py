"""Chains that grow in the frequency response, mass by mass.

From one rigid mass: where the response of the fitted chain lacks a resonance most, a mass and a spring are added, and
everything is fitted again.  The few best chains of each length go on.  No black box has to resolve the resonances, and
a resonance that is hidden by another one appears in the next fit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.problem import Problem
from monitor_core.identification.starting.chains import Slots, chain_of_modes, modes_of_chain, problem_of
from monitor_core.identification.starting.modes import BEYOND, Modal, shape, weights
from monitor_core.identification.starting.response import Measured, Response
from monitor_core.identification.starting.search import Found, distinct, errors, settle

_BEAM = 3
"""Chains of each length that go on."""


class Stem(NamedTuple):
    """A chain that was fitted to the response."""

    response: Response
    end: Found
    slots: Slots | None

    @property
    def cost(self) -> float:
        """Of the end."""
        return self.end.cost

    @property
    def known(self) -> Modal:
        """Its modes."""
        values = self.response.named(self.end.x)
        if self.slots is None:
            J, fm = values["J1"], values["fm"]
            return Modal(np.zeros(1), np.array([1 / J]), np.array([fm / J]))
        # Frequencies and weights without the losses, decays of the drive's own poles.
        return Modal(*modes_of_chain(self.slots.chain(values)), self.slots.decays(values))


def rigid(measured: Measured) -> tuple[Stem, ...]:
    """One mass."""
    low = 2 * np.pi * measured.frequency_hz[:1]
    # If the response is known only above the first resonance, the best weight of the rigid motion may be zero.
    a = float(weights(measured, np.zeros(1), low / 2)[0]) or _size(measured)
    response = Response(
        problem_of(1, measured.output, friction=("fm",)), {"J1": 1 / a, "fm": float(low[0]) / 2 / a}
    )
    return (Stem(response, settle(response, measured, response.start), None),)


def _size(measured: Measured) -> float:
    """The reciprocal of the inertia that a mass alone would have, by the size of the response."""
    w = 2 * np.pi * measured.frequency_hz
    order = 1 if measured.output == "speed" else 2
    return float(np.median(np.abs(measured.target().G) * w**order))


def longer(problem: Problem, stems: Sequence[Stem], measured: Measured) -> tuple[Stem, ...]:
    """Chains with one mass more, ``problem``'s, grown out of shorter ones; the best first."""
    slots = Slots(problem)
    return tuple(distinct(one for stem in stems for one in _grown(problem, slots, stem, measured)))[:_BEAM]


def stems(measured: Measured, masses: int) -> tuple[Stem, ...]:
    """Chains of so many masses, grown from one."""
    found = rigid(measured)
    for n in range(2, masses + 1):
        found = longer(problem_of(n, measured.output, friction=("fm",)), found, measured)
    return found


def _grown(problem: Problem, slots: Slots, stem: Stem, measured: Measured) -> Iterator[Stem]:
    known = stem.known
    for mode in lacking(stem.response, stem.end.x, measured):
        modal = joined(known, mode)
        try:
            values = slots.values(chain_of_modes(modal.p, modal.a), modal.decay)
        except (ValueError, np.linalg.LinAlgError):
            continue
        response = Response(problem, values)
        yield Stem(response, settle(response, measured, response.start), slots)


# --- One more mass: the resonance that the response of a fitted drive lacks most --------------------------------------


# With the relative errors e of a fit, their slopes J and the shape c of a further mode, all weighted, the cost falls
# by (c_' e)^2 / c_'c_,        c_ = c - J (J'J)^-1 J'c to first order if that mode joins in: Rao's score test of its
# weight, over a grid of frequencies and decays.  Masses and springs of the longer chain follow from its resonances in
# closed form, whatever the weight, so each candidate makes sense.

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


def lacking(response: Response, x: Floats, measured: Measured) -> tuple[Mode, ...]:
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
    chosen = peaks[np.argsort(-gain[peaks])[:_MOST]]
    return tuple(
        Mode(float(p[k]), float(a[best[k], k]), float(_RATIOS[best[k]] * p[k]), float(gain[k]))
        for k in chosen
    )


def joined(known: Modal, mode: Mode) -> Modal:
    """With one more."""
    low, high = (factor * known.a.max() for factor in _WEIGHTS)
    p, a = np.append(known.p, mode.p), np.append(known.a, np.clip(mode.a, low, high))
    order = np.argsort(p)
    return Modal(p[order], a[order], np.append(known.decay, mode.decay)[order])


def _stacked(values: np.ndarray) -> Floats:
    return np.concatenate([values.real, values.imag])
