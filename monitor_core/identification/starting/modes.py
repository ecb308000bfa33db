"""Resonances: those of a black box as a chain of n masses would have them, and chains that grow by one at a time.

A real residue rho of a pole s in continuous time is, held over h and sampled, rho (e^{sh} - 1) / s at e^{sh}; what is
left of damping in the phase of the residue is neglected.  The weights are fitted to the measured response, and are not
negative.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from monitor_core.arrays import Floats
from monitor_core.drive.structure import Output
from monitor_core.identification.black_boxes.arx import Arx
from monitor_core.identification.black_boxes.frequency_response import Complexes
from monitor_core.identification.black_boxes.subspace import Innovations, fit_subspace
from monitor_core.identification.problem import Problem
from monitor_core.identification.starting.chains import Slots, chain_of_modes, modes_of_chain, problem_of
from monitor_core.identification.starting.response import Measured, Response, Target
from monitor_core.identification.starting.search import Found, distinct, errors, settle

_SMALLEST = 0.01
"""Weight of a resonance as part of the largest: one that is not seen gets this."""
BEYOND = 1.3
"""Of the highest frequency measured: resonances a little above it are felt."""
_SLOWEST = 0.02
"""Decay of the rigid motion, as part of the lowest frequency, where no pole tells it."""
_PASTS = (0, 2, 4)
"""States of a black box beyond those of the drive."""


class Modal(NamedTuple):
    """Resonances p (n,) rad/s, the first 0; weights a (n,) 1/(kg m^2); decays (n,) 1/s."""

    p: Floats
    a: Floats
    decay: Floats


def black_boxes(measured: Measured, masses: int) -> Iterator[tuple[str, Complexes, Complexes]]:
    """What they are, with poles and residues in z: G = sum r_i / (z - z_i)."""
    order = 2 * masses - 1 + (measured.output == "angle")
    for more in _PASTS:
        try:
            box = fit_subspace(measured.series, order + more)
        except (ValueError, np.linalg.LinAlgError):
            continue
        yield f"a subspace model of order {order + more}", *_of_box(box)
    yield f"an ARX model of order {measured.arx.a.size}", *_of_arx(measured.arx)


def modal(measured: Measured, masses: int, poles: Complexes, residues: Complexes) -> Modal:
    """The most important resonances, and the rigid motion.

    Raises:
        ValueError: there are fewer than the chain needs.
    """
    h = measured.arx.interval_s
    good = np.abs(poles - 0.5) < 0.5 + 1e-3
    good |= (poles.imag != 0) & (np.abs(poles) > 1e-3)
    s, r = np.log(poles[good].astype(complex)) / h, residues[good]
    height = np.abs(r) / np.maximum(-s.real * h, 1e-4)
    low, high = 2 * np.pi * measured.frequency_hz[[0, -1]]
    pairs = np.flatnonzero((s.imag > low) & (s.imag < BEYOND * high) & (s.real < 0))
    if pairs.size < masses - 1:
        raise ValueError(f"{pairs.size} resonances were found, {masses} masses have {masses - 1}")
    chosen = pairs[np.argsort(-height[pairs])[: masses - 1]]
    chosen = chosen[np.argsort(np.abs(s[chosen]))]
    decay = np.concatenate([[_rigid(s, height, low)], -s[chosen].real])
    p = np.concatenate([[0.0], np.abs(s[chosen])])
    return Modal(p, weights(measured, p, decay), decay)


def _rigid(s: Complexes, height: Floats, low: float) -> float:
    """Decay of the slow real pole; that of the integrator of an angle is slower than any record shows."""
    real = np.flatnonzero((s.imag == 0) & (s.real < -_SLOWEST * low) & (s.real > -20 * low))
    return float(-s[real[np.argmax(height[real])]].real) if real.size else low / 2


def weights(measured: Measured, p: Floats, decay: Floats) -> Floats:
    """Of modes (n,), not negative, that come next to the response."""
    target = measured.target()
    columns = np.column_stack([shape(target, w, d, measured.output) for w, d in zip(p, decay, strict=True)])
    columns *= (target.weight / np.abs(target.G))[:, None]
    right = target.weight * target.G / np.abs(target.G)
    a = nnls(np.vstack([columns.real, columns.imag]), np.concatenate([right.real, right.imag]))[0]
    return np.asarray(np.maximum(a, _SMALLEST * a.max()), dtype=np.float64)


def shape(target: Target, p: float, decay: float, output: Output) -> Complexes:
    """Response (F,) of a mode with weight 1."""
    swings = 1j * np.sqrt(max(p**2 - decay**2, 0.0)) * np.array([1, -1])
    s = np.array([-decay + 0j]) if p == 0 else -decay + swings
    z, h = np.exp(s * target.interval_s), target.interval_s
    G = ((z - 1) / s / s.size / (target.z[:, None] - z)).sum(axis=1)
    if output == "speed":
        return np.asarray(G)
    # The angle: each mode's integral, s^-1, and the integrator with what is left.
    G = ((z - 1) / s**2 / s.size / (target.z[:, None] - z)).sum(axis=1)
    return np.asarray(G - (1 / s).sum() / s.size * h / (target.z - 1))


def _of_box(box: Innovations) -> tuple[Complexes, Complexes]:
    poles, V = np.linalg.eig(box.A.astype(np.complex128))
    return poles, (box.C @ V) * np.linalg.solve(V, box.B.astype(np.complex128))


_MOST_DIGITS = -250.0


def _of_arx(arx: Arx) -> tuple[Complexes, Complexes]:
    """Poles z_i and residues  B(z_i) z_i / prod_j (1 - z_j / z_i).

    Poles so near zero that their powers overflow have died out within a sample or two: they are no modes of a drive.
    """
    poles = np.roots(np.concatenate([[1.0], arx.a])).astype(np.complex128)
    poles = poles[abs(poles) > 10 ** (_MOST_DIGITS / (arx.b.size + 1))]
    B = (1 / poles[:, None]) ** np.arange(1, arx.b.size + 1) @ arx.b
    # A = prod (1 - z_i / z): near z_i it is (z - z_i) / z_i times the others.
    others = np.array([np.prod(1 - np.delete(poles, i) / z) for i, z in enumerate(poles)])
    return poles, np.asarray(B * poles / others)


# --- Chains that grow in the frequency response, mass by mass ---------------------------------------------------------


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
    return tuple(distinct(chain for stem in stems for chain in _grown(problem, slots, stem, measured)))[
        :_BEAM
    ]


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
