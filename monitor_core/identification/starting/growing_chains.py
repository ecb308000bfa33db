"""Chains of masses that grow in the frequency response, from one mass, by the resonance that is lacking most.

A real residue rho of a pole s in continuous time is, held over h and sampled, rho (e^{sh} - 1) / s at e^{sh}; what is
left of damping in the phase of the residue is neglected.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Complexes, Floats
from monitor_core.drive.structure import Output
from monitor_core.identification.problem import Problem
from monitor_core.identification.starting.chains import (
    ChainParameters,
    chain_of_modes,
    modes_of_chain,
    problem_of,
)
from monitor_core.identification.starting.response import Measured, Response, Target
from monitor_core.identification.starting.search import SearchEnd, distinct, errors, settle

_BEAM = 3
"""Number of chains of each length that are continued."""


class Modal(NamedTuple):
    """Resonances p (n,) rad/s, the first 0; weights a (n,) 1/(kg m^2); decays (n,) 1/s."""

    p: Floats
    a: Floats
    decay: Floats


class FittedChain(NamedTuple):
    """A chain that was fitted to the response."""

    response: Response
    end: SearchEnd
    parameters: ChainParameters

    @property
    def cost(self) -> float:
        """Cost at the end of the search."""
        return self.end.cost

    @property
    def known(self) -> Modal:
        """Its modes: frequencies and weights without the losses, decays of the drive's own poles."""
        values = self.response.named(self.end.x)
        return Modal(*modes_of_chain(self.parameters.chain(values)), self.parameters.decays(values))


def grown_chains(problem: Problem, measured: Measured) -> tuple[FittedChain, ...]:
    """The chain of a problem's drive, grown from one mass; the best first, none where no further mode is seen.

    Raises:
        ValueError: the motor does not see a chain of masses that are all free.
    """
    masses = ChainParameters(problem).masses
    if masses == 1:
        return rigid(problem, measured)
    shorter = problem_of(masses - 1, measured.output, friction=("fm",))
    return longer(problem, grown_chains(shorter, measured), measured)


def rigid(problem: Problem, measured: Measured) -> tuple[FittedChain, ...]:
    """One mass, from the size of the response: its inertia is right where only inertia counts."""
    w = 2 * np.pi * measured.frequency_hz
    order = 1 if measured.output == "speed" else 2
    a = np.median(np.abs(measured.target().G) * w**order)
    return tuple(_settled(problem, ChainParameters(problem), Modal(np.zeros(1), np.array([a]), w[:1] / 2), measured))


def longer(problem: Problem, shorter: Sequence[FittedChain], measured: Measured) -> tuple[FittedChain, ...]:
    """Chains with one mass more, ``problem``'s, grown out of shorter ones; the best first."""
    parameters = ChainParameters(problem)
    grown = (
        longer_chain
        for chain in shorter
        for mode in lacking(chain.response, chain.end.x, measured)
        for longer_chain in _settled(problem, parameters, joined(chain.known, mode), measured)
    )
    return tuple(distinct(grown))[:_BEAM]


def _settled(problem: Problem, parameters: ChainParameters, modal: Modal, measured: Measured) -> Iterator[FittedChain]:
    """The chain with these modes, fitted; none where there is no such chain."""
    try:
        values = parameters.values(chain_of_modes(modal.p, modal.a), modal.decay)
    except (ValueError, np.linalg.LinAlgError):
        return
    response = Response(problem, values)
    yield FittedChain(response, settle(response, measured, response.start), parameters)


# --- One more mass: the resonance that the response of a fitted drive lacks most --------------------------------------


# With the relative errors e of a fit, their slopes J and the shape c of a further mode, all weighted, the cost falls by
#     (c_' e)^2 / c_'c_,        c_ = c - J (J'J)^-1 J'c
# to first order if that mode joins in: Rao's score test of its weight, over a grid of frequencies and decays.  Masses
# and springs of the longer chain follow from its resonances in closed form, whatever the weight, so each candidate
# makes sense.

_MAX_FREQUENCY_RATIO = 1.3
"""Candidates reach up to this multiple of the highest measured frequency, as resonances slightly above it matter."""
_FREQUENCIES = 200
_DECAY_RATIOS = (0.01, 0.03, 0.1)
"""Decay over frequency."""
_WEIGHT_RANGE = (0.01, 1.0)
"""Least and largest weight of a further mode, in units of the largest known."""
_MAX_MODES = 4


class ChainMode(NamedTuple):
    """Frequency, rad/s; weight, 1/(kg m^2); decay, 1/s; and the expected decrease of the cost."""

    p: float
    a: float
    decay: float
    gain: float


def lacking(response: Response, x: Floats, measured: Measured) -> tuple[ChainMode, ...]:
    """Modes that would help the fit at x (p,) most, each the best of its surroundings."""
    target = measured.target()
    e, J = (_stacked(part) for part in errors("linear", target, *response.at(x, target)))
    Q, _ = np.linalg.qr(J)
    low, high = 2 * np.pi * measured.frequency_hz[[0, -1]]
    p = np.linspace(low, _MAX_FREQUENCY_RATIO * high, _FREQUENCIES)
    gains, a = np.empty((2, len(_DECAY_RATIOS), p.size))
    for i, ratio in enumerate(_DECAY_RATIOS):
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
    chosen = peaks[np.argsort(-gain[peaks])[:_MAX_MODES]]
    return tuple(
        ChainMode(float(p[k]), float(a[best[k], k]), float(_DECAY_RATIOS[best[k]] * p[k]), float(gain[k]))
        for k in chosen
    )


def joined(known: Modal, mode: ChainMode) -> Modal:
    """The known modes with one more."""
    low, high = (factor * known.a.max() for factor in _WEIGHT_RANGE)
    p, a = np.append(known.p, mode.p), np.append(known.a, np.clip(mode.a, low, high))
    order = np.argsort(p)
    return Modal(p[order], a[order], np.append(known.decay, mode.decay)[order])


def shape(target: Target, p: float, decay: float, output: Output) -> Complexes:
    """Response (F,) of a mode with weight 1."""
    swings = 1j * np.sqrt(max(p**2 - decay**2, 0.0)) * np.array([1, -1])
    s = np.array([-decay + 0j]) if p == 0 else -decay + swings
    z, h = np.exp(s * target.interval_s), target.interval_s
    G = ((z - 1) / s / s.size / (target.z[:, None] - z)).sum(axis=1)
    if output == "speed":
        return np.asarray(G)
    # For the angle: the integral (1/s) of each mode, and an integrator for the rest.
    G = ((z - 1) / s**2 / s.size / (target.z[:, None] - z)).sum(axis=1)
    return np.asarray(G - (1 / s).sum() / s.size * h / (target.z - 1))


def _stacked(values: np.ndarray) -> Floats:
    return np.concatenate([values.real, values.imag])
