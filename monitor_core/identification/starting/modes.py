"""Resonances of a black box: the frequencies, decays and weights that a chain of n masses would have.

A real residue rho of a pole s in continuous time is, held over h and sampled, rho (e^{sh} - 1) / s at e^{sh}; what is
left of damping in the phase of the residue is neglected.  The weights are fitted to the measured response, and are not
negative.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from monitor_core.arrays import Floats
from monitor_core.drive.structure import Output
from monitor_core.identification.black_boxes.arx import Arx
from monitor_core.identification.black_boxes.frequency_response import Complexes
from monitor_core.identification.black_boxes.subspace import Innovations, fit_subspace
from monitor_core.identification.starting.response import Measured, Target

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
