"""Which links of an arm load an axis: cosines and sines of sums of joint angles that its torque shows.

The potential energy of a serial arm is a sum of products of cosines and sines of its joint angles, and so of cosines
and sines of their sums and differences.  The weight that an axis holds is its derivative by the angle of that axis:
terms without that angle drop out.  How the joints are counted, from where, and in which direction, does not matter:
each sum comes with both signs of the other angles, and each with cosine and sine.

    J w' + f w + fc sign(w) + tau0 + sum_i (c_i cos s_i + d_i sin s_i) = u,    s_i = q_own +- q_j +- q_k
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats
from monitor_core.drive.signal_terms import Factor
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.records.rigid_body import speed_scales
from monitor_core.identification.records.torque_windows import (
    USUAL,
    WINDOWS,
    GridPart,
    balance_equations,
    least_speed,
    moving_windows,
    of_unit_length,
    rms_speed,
    windowed,
    windowed_parts,
)

_MOST_SAMPLES = 30_000
"""Weights change slowly: longer records are thinned to about so many samples."""
_OF_PERIOD, _FEWEST = 0.1, 24
"""Window of the torque balance: of the usual period of the motion, in which a weight hardly changes; in samples."""
_LEAST_WINDOWS = 20
"""In all records: fewer do not distinguish this many terms."""
_MOST_OTHERS = 2
"""Other angles in a sum: shoulder, elbow and a wrist that bends in the same plane."""
_MOST_SUMS = 8
_LESS = 0.6
"""Of the squared errors on what was not fitted: another sum leaves at most so much of them,"""
_MORE = 0.01
"""or, where a weight shows already, explains so much of the variance of the torque: on the bending axis of a wrist a
weight is the sum of many."""
_SIMPLER = 0.9
"""A sum of more angles leaves at most so much of what the best one of fewer leaves."""
_NEEDED = 1.02
"""Without a single cosine or sine that is needed, the squared errors are at least so many times as large."""
_EXPLAINS = 0.5
"""Part of the torque that is explained where it was not fitted, or the weights are none."""

_MATTERS = 0.003
"""Part of the variance of the torque that weights explain, or they are what friction lacks."""

Sum = tuple[tuple[int, str], ...]
"""A sum of angles, by the names of their signals, each with its sign"""


class LinkWeights(NamedTuple):
    """What loads an axis."""

    terms: tuple[str, ...]
    """"cos(axis2 + axis3)", .."""
    explained: float
    """part of the torque that is explained in each half of the records, with values of the other half"""
    before: float
    """the same without these terms"""


def link_weights(records: Sequence[Record], own: str, angles: Sequence[str]) -> LinkWeights | None:
    """The weights that the torque of an axis shows; None: none that explains it.

    Args:
        records: of the axis, whose angle is measured, with the angles of the arm's axes as signals [rad].
        own: name of the signal that is the angle of the axis itself.
        angles: names of all of them, own too, from the base to the hand.
    """
    parts, window = slow_parts(records, angles)
    if not parts:
        return None
    balance = _Balance(parts, window, speed_scales(records)[1])
    chosen = _waves(*_chosen(balance, own, angles))
    if not chosen:
        return None
    needed, left = chosen, balance.left(chosen)
    for wave in chosen:
        fewer = [w for w in needed if w != wave]
        if fewer and balance.left(fewer) < _NEEDED * left:
            needed = fewer
    explained, before = balance.explained(needed), balance.explained(())
    if explained < _EXPLAINS or (1 - before) ** 2 - (1 - explained) ** 2 < _MATTERS:
        return None
    return LinkWeights(tuple(map(str, needed)), explained, before)


def slow_parts(records: Sequence[Record], angles: Sequence[str]) -> tuple[list[GridPart], int]:
    """Parts of records where these angles are known, and the window of their torque balance; none: too few windows."""
    parts = [
        _thinned(part)
        for part in windowed_parts(records)
        if all(np.isfinite(part.signals[name]).all() for name in angles)
    ]
    window = _window(records, parts)
    parts = [part for part in parts if len(part.u) > window]
    enough = sum(len(part.u) for part in parts) >= _LEAST_WINDOWS * window
    return (parts if enough else []), window


def _window(records: Sequence[Record], parts: Sequence[GridPart]) -> int:
    """Length of the window of the torque balance, in samples."""
    speed = rms_speed(records)
    if not parts or not speed > 0:
        return _FEWEST
    turned = np.concatenate([part.y - part.y.mean() for part in parts])
    period_s = 2 * np.pi * float(np.sqrt(np.mean(turned**2))) / speed
    return max(_FEWEST, round(_OF_PERIOD * period_s / parts[0].h))


def _chosen(balance: _Balance, own: str, angles: Sequence[str]) -> list[Sum]:
    """Sums of angles, one after the other, as long as the next one explains what was not fitted.

    Two links may hide each other, so a second one is looked for where the first alone explains little.  A sum that was
    chosen while another one was missing is exchanged for what is better beside that one.
    """
    chosen = list[Sum]()
    left = balance.left(())
    while len(chosen) < _MOST_SUMS:
        best, least = _best(balance, own, angles, chosen)
        if not balance.matters(least, left, 1, bool(chosen)):
            near = [*_sums(own, angles, 0), *_sums(own, angles, 1)]
            beside = [(_best(balance, own, angles, [*chosen, first]), first) for first in near]
            (best, least), first = min(beside, key=lambda pair: pair[0][1])
            if first in chosen or not balance.matters(least, left, 2, bool(chosen)):
                break
            chosen = [*chosen, first]
        chosen, left = [*chosen, best], least
        for place in range(len(chosen) - 1):
            others = [*chosen[:place], *chosen[place + 1 :]]
            best, least = _best(balance, own, angles, others)
            if least < _SIMPLER * left:
                chosen, left = [*others, best], least
    return chosen


def _best(balance: _Balance, own: str, angles: Sequence[str], chosen: Sequence[Sum]) -> tuple[Sum, float]:
    """The sum that explains most beside others, and what is left; of fewer angles, unless more explain clearly more."""
    best: Sum = ()
    least = np.inf
    for count in range(_MOST_OTHERS + 1):
        tried = [angles_in for angles_in in _sums(own, angles, count) if angles_in not in chosen]
        with_it = [balance.left([*_waves(*chosen), *_waves(angles_in)]) for angles_in in tried]
        if with_it and min(with_it) < _SIMPLER * least:
            least, best = min(with_it), tried[int(np.argmin(with_it))]
    return best, least


def _values(wave: Factor, part: GridPart) -> Floats:
    """A cosine or a sine of a sum of angles (N,)."""
    total = sum((sign * part.signals[name] for sign, name in wave.addends), np.zeros(len(part.u)))
    return np.asarray(np.cos(total) if wave.function == "cos" else np.sin(total))


def _waves(*sums: Sum) -> list[Factor]:
    return [Factor(function, angles) for angles in sums for function in ("cos", "sin")]


def _sums(own: str, angles: Sequence[str], count: int) -> Iterator[Sum]:
    """The own angle with so many others, the first one with a plus, the others with either sign."""
    others = [name for name in angles if name != own]
    for names in combinations(others, count):
        used = [name for name in angles if name == own or name in names]
        for signs in product((1, -1), repeat=count):
            yield tuple(zip((1, *signs), used, strict=True))


def _thinned(part: GridPart) -> GridPart:
    """Means over blocks of samples, if there are too many."""
    block = -(-len(part.u) // _MOST_SAMPLES)
    if block == 1:
        return part
    count = len(part.u) // block

    def means(values: Floats) -> Floats:
        return np.asarray(values[: count * block].reshape(count, block).mean(axis=1))

    signals = {name: means(values) for name, values in part.signals.items()}
    return GridPart(means(part.u), means(part.y), part.h * block, part.quantity, signals)


def windows_of_motion(parts: Sequence[GridPart], window: int) -> Bools:
    """In which windows (M,) of all parts the axis moves: where it stands, friction may be anything, as a weight may."""
    least = least_speed(parts)
    if least is not None:
        kept = np.concatenate([moving_windows(part, window, least) for part in parts])
        if kept.sum() >= _LEAST_WINDOWS * WINDOWS:
            return kept
    return np.ones(len(windowed(parts, window, [part.u for part in parts])), np.bool_)


class _Balance:
    """The torque balance of one mass, with waves beside it: fitted to each half, and tried on the other."""

    def __init__(self, parts: Sequence[GridPart], window: int, scale: float) -> None:
        self._parts, self._window = parts, window
        self._kept = windows_of_motion(parts, window)
        self._rows, self._torque = (
            array[self._kept] for array in balance_equations(parts, window, scale, USUAL)
        )
        self._columns: dict[Factor, Floats] = {}
        self._half = len(self._torque) // 2
        self._spread = float(((self._torque - self._torque.mean()) ** 2).sum())

    def left(self, waves: Sequence[Factor]) -> float:
        """Sum of squared errors in each half with values of the other one."""
        rows = np.column_stack([self._rows, *(self._column(wave) for wave in waves)])
        rows = of_unit_length(rows)
        total, halves = 0.0, (slice(self._half), slice(self._half, None))
        for fitted, other in (halves, halves[::-1]):
            found, *_ = np.linalg.lstsq(rows[fitted], self._torque[fitted], rcond=1e-8)
            missed = self._torque[other] - rows[other] @ found
            total += float(missed @ missed)
        return total

    def matters(self, least: float, left: float, sums: int, beside: bool) -> bool:
        """Whether so many more sums leave little enough of the squared errors; ``beside``: of others."""
        return least < _LESS**sums * left or (beside and left - least > sums * _MORE * self._spread)

    def explained(self, waves: Sequence[Factor]) -> float:
        """Part of the torque about its mean."""
        return 1 - float(np.sqrt(self.left(waves) / self._spread)) if self._spread > 0 else 0.0

    def _column(self, wave: Factor) -> Floats:
        if wave not in self._columns:
            values = (_values(wave, part) for part in self._parts)
            self._columns[wave] = windowed(self._parts, self._window, values)[self._kept]
        return self._columns[wave]
