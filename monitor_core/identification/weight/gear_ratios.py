"""Finds gear ratios from the weight of an arm's links, if only the angles of the motors are known.

The weight that an axis holds turns with sums of the angles of the arm (``arm_links``).  Where these are angles of
motors before their gears, m_j, the ratios r_j = arm angle / motor angle are those that explain the torque best:

    J w' + f w + fc sign(w) + tau0 + sum_i (c_i cos s_i + d_i sin s_i) = u,    s_i = r_own m_own +- r_j m_j +- r_k m_k

A program turns an arm by a few radians: a ratio that is wrong by a tenth changes an angle by a few tenths.  So trials
of all ratios in such steps find the least of the unexplained torque, and Gauss-Newton goes on from there.
"""

from collections.abc import Collection, Mapping, Sequence
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from monitor_core.arrays import Floats
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import speed_scales
from monitor_core.identification.torque_balance.torque_windows import (
    GridPart,
    of_unit_length,
    residual_torque,
)
from monitor_core.identification.weight.arm_energies import AngleSum
from monitor_core.identification.weight.weight_balance import WeightBalance, slow_parts

_TURNS = np.geomspace(0.3, 2 * np.pi, 40)
"""Turns of the arm over the record, rad, that are tried; further axes hardly turn by more than a whole turn."""
_MAX_REMAINING = 0.6
"""A further angle must reduce the squared errors to less than this share."""


def gear_ratios(
    records: Sequence[Record],
    own: str,
    angles: Sequence[str],
    motors: Collection[str],
    accelerations: Sequence[str] = (),
) -> Mapping[str, float]:
    """Arm angle over motor angle, by the name of the motor's signal, for each motor that moves the weight on an axis.

    Empty if the torque shows no weight that depends on angles, or if the axis itself is not one of the motors.

    Args:
        records: of the axis, whose angle is measured, with all angles as signals [rad].
        own: name of the signal that is the angle of the axis itself.
        angles: names of all of them, own too.
        motors: those that are angles of motors, before gears of unknown ratio; the others are angles of the arm.
        accelerations: names of signals that are those of other axes, whose torque may hide the weight.
    """
    if own not in motors:
        return {}
    parts, window = slow_parts(records, (*angles, *accelerations))
    if not parts:
        return {}
    trial = _RatioSearch(parts, window, angles, accelerations, speed_scales(records)[1])
    ratios, sums, left = _first(trial, own)
    for _ in range(2):
        tried = [_with_another(trial, own, other, motors, ratios, sums) for other in angles if other not in ratios]
        best = min(tried, key=lambda found: found[2], default=None)
        if best is None or not best[2] < _MAX_REMAINING * left:
            break
        ratios, sums, left = best
    # A ratio with which the arm hardly turns, or turns many times, does not come from a weight.
    turns = {name: ratio * trial.extent(name) for name, ratio in ratios.items() if name in motors}
    if not all(_TURNS[0] / 2 < turn < 2 * _TURNS[-1] for turn in turns.values()):
        return {}
    return {name: ratios[name] for name in turns}


_RatioFit = tuple[dict[str, float], list[AngleSum], float]
"""Ratios of the used angles, their sums, and the unexplained part of the squared torque"""


class _RatioSearch:
    """The torque balance in windows, with the mean angle of each window: a weight hardly changes within one."""

    def __init__(
        self,
        parts: Sequence[GridPart],
        window: int,
        angles: Sequence[str],
        accelerations: Sequence[str],
        scale: float,
    ) -> None:
        balance = WeightBalance(parts, window, scale)
        coupled = [balance.column([part.signals[name] for part in parts]) for name in accelerations]
        self.rows, self.torque = of_unit_length(np.column_stack([balance.rows, *coupled])), balance.torque
        means = {name: balance.mean([part.signals[name] for part in parts]) for name in angles}
        self.angles = {name: angle - angle.mean() for name, angle in means.items()}

    def extent(self, name: str) -> float:
        """Range of an angle, rad."""
        return float(np.ptp(self.angles[name])) or 1.0

    def trials(self, name: str, unknown: bool) -> Floats:
        """Candidates of the ratio of an angle."""
        return _TURNS / self.extent(name) if unknown else np.ones(1)

    def phase(self, ratios: Mapping[str, float], angles: AngleSum) -> Floats:
        """A sum of angles (M,), rad."""
        return np.asarray(sum(sign * ratios[name] * self.angles[name] for sign, name in angles))

    def columns(self, ratios: Mapping[str, float], sums: Sequence[AngleSum]) -> Floats:
        """Columns that are fitted to the torque: one mass with friction and couplings, cosine and sine of each sum."""
        phases = [self.phase(ratios, angles) for angles in sums]
        return np.column_stack([self.rows, *(wave(p) for p in phases for wave in (np.cos, np.sin))])

    def missed(self, ratios: Mapping[str, float], sums: Sequence[AngleSum]) -> Floats:
        """The torque (M,) that these ratios do not explain."""
        return residual_torque(self.columns(ratios, sums), self.torque)

    def least(self, known: Floats, phases: Floats) -> tuple[int, float]:
        """Index of the sum (of M, G) that explains most in addition to known columns, and the unexplained part."""
        Q = np.linalg.qr(known)[0]
        e = self.torque - Q @ (Q.T @ self.torque)
        c, s = np.cos(phases), np.sin(phases)
        c, s = c - Q @ (Q.T @ c), s - Q @ (Q.T @ s)
        cc, ss, cs, ce, se = (c * c).sum(0), (s * s).sum(0), (c * s).sum(0), e @ c, e @ s
        det = cc * ss - cs * cs
        explained = np.where(det > 1e-9 * cc * ss, (ce**2 * ss - 2 * ce * se * cs + se**2 * cc) / det, 0.0)
        best = int(np.argmax(explained))
        return best, float(e @ e - explained[best])

    def refined(self, ratios: dict[str, float], sums: list[AngleSum], free: Sequence[str]) -> _RatioFit:
        """Refine the ratios so that the unexplained torque is least."""

        def ratios_at(x: Floats) -> dict[str, float]:
            return ratios | dict(zip(free, np.exp(x).tolist(), strict=True))

        def missed_at(x: Floats) -> Floats:
            return self.missed(ratios_at(x), sums)

        found = least_squares(missed_at, np.log([ratios[name] for name in free]), x_scale=0.1)
        return ratios_at(found.x), sums, float(2 * found.cost)


def _first(trial: _RatioSearch, own: str) -> _RatioFit:
    """The weight that turns with the axis itself."""
    ratios = trial.trials(own, unknown=True)
    best, _ = trial.least(trial.rows, np.outer(trial.angles[own], ratios))
    return trial.refined({own: float(ratios[best])}, [((1, own),)], [own])


def _with_another(
    trial: _RatioSearch,
    own: str,
    other: str,
    motors: Collection[str],
    ratios: Mapping[str, float],
    sums: Sequence[AngleSum],
) -> _RatioFit:
    """A further angle, in a sum with all used so far; with the first one, the own ratio is searched again."""
    beside = [name for name in ratios if name != own]
    signs = list(product((1, -1), repeat=1 + len(beside)))
    with_all = [tuple(zip((1, *s), (own, other, *beside), strict=True)) for s in signs]
    others = trial.trials(other, other in motors)
    owns = np.array([ratios[own]]) if beside else trial.trials(own, unknown=True)
    tried = []
    for r in owns.tolist():
        known = dict(ratios) | {own: r}
        phases = [
            trial.phase(known | {other: 0.0}, angles)[:, None] + sign * np.outer(trial.angles[other], others)
            for angles, (sign, *_) in zip(with_all, signs, strict=True)
        ]
        best, left = trial.least(trial.columns(known, sums), np.concatenate(phases, axis=1))
        which, ratio = divmod(best, len(others))
        tried.append((left, known | {other: float(others[ratio])}, with_all[which]))
    _, found, angles = min(tried, key=lambda trial_: trial_[0])
    return trial.refined(found, [*sums, angles], [name for name in found if name in motors])
