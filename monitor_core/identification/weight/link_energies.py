"""Finds the energies of an arm whose torques act on an axis, above all those of its inertia, which follow the pose.

The terms (``arm_energies``) are chosen one by one by cross-validation: the values are fitted to one half of the data,
and the error is that of the other half, and vice versa.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.identification.torque_balance.torque_windows import WINDOWS, GridPart
from monitor_core.identification.weight.arm_energies import Energy, Poses
from monitor_core.identification.weight.pose_polynomials import PoseEnergy
from monitor_core.identification.weight.weight_balance import DETERMINED, MIN_INCREASE, WeightBalance

_MOST_SUMS = 16
_MAX_REMAINING = 0.95
"""A further sum must reduce the squared errors to at most this share, .."""
_BY_CHANCE = 6.0
""".. and by more than the best of so many sums does by chance: a chi-square of 2 ln(number), thrice that as errors
are alike for some windows."""
_CLEARLY_LESS = 0.95
"""A sum that was chosen before a later one is exchanged if another one leaves at most this share of the errors."""
_WELL_DETERMINED = 1e-6
"""Further energies are well determined if beside the others this share of their squares is left."""


AnyEnergy = Energy | PoseEnergy


class LinkEnergies(NamedTuple):
    """Energies whose torque acts on an axis, and how well all terms explain it."""

    found: tuple[AnyEnergy, ...]
    explained: float
    """share of the torque that is explained in each half of the records, with values of the other half"""
    before: float
    """the same without these energies"""
    needless: tuple[int, ...]
    """indices of the given terms that explain nothing in addition to these energies"""
    undetermined: tuple[str, ...]
    """further angles that these energies may follow as well: the records do not tell"""


def link_energies(balance: EnergyBalance) -> LinkEnergies:
    """The energies of links whose torque acts on the axis of this balance.

    Sums are added one by one as long as the next one reduces the error, and exchanged if another one is better together
    with a later one.  Then single cosines and sines, and given terms, are left out if they explain nothing.
    """
    before = balance.error(())
    sums, left = list[int](), before
    while len(sums) < _MOST_SUMS:
        best, least = balance.best(sums)
        if not least < balance.max_remaining * left:
            break
        sums, left = [*sums, best], least
        for place in range(len(sums) - 1):
            others = [*sums[:place], *sums[place + 1 :]]
            best, least = balance.best(others)
            if least < _CLEARLY_LESS * left:
                sums, left = [*others, best], least
    chosen = [index for number in sums for index in balance.same_sum[number]]
    for index in tuple(chosen):
        fewer = [other for other in chosen if other != index]
        if balance.error(fewer) < MIN_INCREASE * left:
            chosen = fewer
    needless = list[int]()
    for index in range(balance.given if chosen else 0):
        if balance.error(chosen, (*needless, index)) < MIN_INCREASE * left:
            needless.append(index)
    found = tuple(balance.energies[index] for index in chosen)
    return LinkEnergies(
        found,
        balance.share_explained(balance.error(chosen)),
        balance.share_explained(before),
        tuple(needless),
        _undetermined(balance, sums, left, {angle for energy in found for angle in energy.followed}),
    )


def _undetermined(balance: EnergyBalance, sums: Sequence[int], left: float, used: Collection[str]) -> tuple[str, ...]:
    """The angles that are not used, but are in a sum that explains about as much as a chosen one.

    ``left``: the error with the chosen ``sums``.
    """
    found = dict[str, None]()
    for place, energies in enumerate(balance.same_sum):
        energy = balance.energies[energies[0]]
        new = [angle for angle in energy.exchangeable if angle not in used and angle not in found]
        if not new:
            continue
        exchanged = min(
            (balance.sums_error([place, *(s for s in sums if s != other)]) for other in sums), default=np.inf
        )
        if _CLEARLY_LESS * exchanged < left:
            found.update(dict.fromkeys(new))
    return tuple(found)


class EnergyBalance(WeightBalance):
    """The torque balance with these energies, as normal equations of each half of the windows.

    With many candidates, and few of them chosen, these are solved much faster than the windows.

    Args:
        parts: pieces of the records of an axis with these angles as signals [rad].
        window: length of the windows, in samples.
        scale: speed scale of Coulomb friction, rad/s.
        own: name of the angle of the axis itself.
        energies: those that may act on the axis (``possible_energies``).
        terms: values (N,) of further terms of the torque in all parts, one after the other.
    """

    def __init__(
        self,
        parts: Sequence[GridPart],
        window: int,
        scale: float,
        own: str,
        energies: Sequence[AnyEnergy],
        terms: Sequence[Floats],
    ) -> None:
        super().__init__(parts, window, scale)
        ends = np.cumsum([len(part.u) for part in parts])[:-1]
        further = [self.column(np.split(values, ends)) for values in terms]
        self.energies = energies
        poses = [Poses(part) for part in parts]
        columns = [self._energy_column(energy, own, poses) for energy in self.energies]
        rows = np.column_stack([self.rows, *further, *columns])
        self._normal, _ = self.normal_equations(rows)
        self.given = len(further)
        """Number of further terms"""
        self._usual = self.rows.shape[1] + self.given
        by_sum = dict[object, list[int]]()
        for index, energy in enumerate(self.energies):
            by_sum.setdefault(energy.of_same_sum, []).append(index)
        self.same_sum = list(by_sum.values())
        """Of each sum, the indices of its energies of the same joints: with cosine and with sine"""
        self._alike = [
            (np.array(places), self._usual + np.array([self.same_sum[place] for place in places]))
            for places in _by_length(self.same_sum)
        ]
        """Places of ``same_sum`` with the same number of energies, and the columns of these"""
        independent = max(len(self.torque) / WINDOWS, 1.0)
        self.max_remaining = min(_MAX_REMAINING, 1 - _BY_CHANCE * np.log(len(by_sum)) / independent)
        """A further sum must reduce the squared errors to at most this share"""

    def best(self, chosen: Sequence[int]) -> tuple[int, float]:
        """The place in ``same_sum`` of what explains most in addition to these places, and the error with it.

        None is preferred for its few angles: the inertia of a base follows the squares of cosines, and with the cosines
        the torque in other poses would be off by half as much again.
        """
        errors = self._errors_beside([index for place in chosen for index in self.same_sum[place]])
        errors[list(chosen)] = np.inf
        for place in np.flatnonzero(np.isnan(errors)).tolist():
            errors[place] = self.sums_error([*chosen, place])
        best = int(np.argmin(errors))
        return best, self.sums_error([*chosen, best])

    def _errors_beside(self, chosen: Sequence[int]) -> Floats:
        """The errors with these energies and those of each place of ``same_sum``, by block elimination.

        NaN where the energies of a place are hardly determined beside the others.
        """
        used = np.concatenate([np.arange(self._usual), self._usual + np.array(chosen, np.int64)])
        missed = np.zeros(len(self.same_sum))
        for (G, b, _), (G_, b_, yy) in (self._normal, self._normal[::-1]):
            base = np.linalg.lstsq(G[np.ix_(used, used)], np.column_stack([b, G])[used], rcond=DETERMINED)[0]
            for places, columns in self._alike:
                X = base[:, 1 + columns].transpose(1, 0, 2)  # (places, used, energies of a place)
                own = columns[:, :, np.newaxis], columns[:, np.newaxis]
                beside = G[columns][:, :, used]  # (places, energies of a place, used)
                left = G[own] - beside @ X
                determined = np.linalg.eigvalsh(left)[:, 0] > _WELL_DETERMINED * G[columns, columns].max(axis=1)
                left[~determined] = np.eye(columns.shape[1])
                found = np.linalg.solve(left, (b[columns] - beside @ base[:, 0])[..., np.newaxis])[..., 0]
                others = base[:, 0] - (X @ found[..., np.newaxis])[..., 0]  # (places, used)
                values = np.concatenate([others, found], axis=1)
                which = np.concatenate([np.tile(used, (len(places), 1)), columns], axis=1)
                square = G_[which[:, :, np.newaxis], which[:, np.newaxis]]
                explained = ((2 * b_[which] - (square @ values[..., np.newaxis])[..., 0]) * values).sum(axis=1)
                missed[places] += np.where(determined, yy - explained, np.nan)
        return missed

    def sums_error(self, places: Sequence[int]) -> float:
        """The error with the energies at these places of ``same_sum``."""
        return self.error([index for place in places for index in self.same_sum[place]])

    def error(self, chosen: Sequence[int], without: Sequence[int] = ()) -> float:
        """Sum of squared errors of each half of the equations with values that were fitted to the other half.

        ``chosen``: energies; ``without``: given terms that are left out.
        """
        usual = np.delete(np.arange(self._usual), self.rows.shape[1] + np.array(without, np.int64))
        used: Ints = np.concatenate([usual, self._usual + np.array(chosen, np.int64)])
        first, last = (half.of_columns(used) for half in self._normal)
        return last.missed_with(first) + first.missed_with(last)

    def _energy_column(self, energy: AnyEnergy, own: str, poses: Sequence[Poses]) -> Floats:
        """The integrals (M,) of the torque of this energy."""
        carried = [part.signals[energy.load] if energy.load else np.ones(len(part.u)) for part in self._parts]
        if not energy.axes:
            return self.column(
                mass * energy.function_values(pose, own)[0] for mass, pose in zip(carried, poses, strict=True)
            )
        j, k = energy.axes
        rates, torques = list[Floats](), list[Floats]()
        for mass, part, pose in zip(carried, self._parts, poses, strict=True):
            v = {angle: np.gradient(part.signals[angle], part.h) for angle in (j, k)}
            f, slope = energy.function_values(pose, own)
            momentum = f * v[k if j == own else j] if own in energy.axes else np.zeros(len(part.u))
            rates.append(mass * momentum)
            torques.append(-mass * slope * v[j] * v[k])
        return self.rate(rates) + self.column(torques)


def _by_length(lists: Sequence[Sequence[int]]) -> list[list[int]]:
    """Indices of lists, together where these are of the same length."""
    found = dict[int, list[int]]()
    for k, entries in enumerate(lists):
        found.setdefault(len(entries), []).append(k)
    return list(found.values())
