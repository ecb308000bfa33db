"""Gates of an axis: while one is closed by a signal, no estimate is updated and no test runs."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Bools, Floats
from monitor_core.wording import Sentence, sentence

_SAME = 1e-6
"""Relative difference below which two values of a signal count as equal: signals are scaled numbers."""
_LONG_AGO_US = -(2**62)
"""Before any sample [us]"""


class Gate(NamedTuple):
    """A gate that is open while its signal is one of ``equals`` (if given) and between ``above`` and ``below``.

    Estimates and tests wait while it is closed.  All values have the unit of the signal.

    ``settle_s``: it stays closed for this time after its signal has the right value again [s], until a force that acted
    has gone, and the prediction has forgotten it.
    """

    signal: str
    equals: tuple[float, ...] = ()
    above: float = -math.inf
    below: float = math.inf
    settle_s: float = 0.0

    def open(self, values: Floats) -> Bools:
        """Whether the gate is open (N,) for values of the signal (N,), regardless of ``settle_s``; NaN closes it."""
        between = (values > self.above) & (values < self.below)
        if not self.equals:
            return np.asarray(between, np.bool_)
        near = [np.abs(values - value) <= _SAME * max(1.0, abs(value)) for value in self.equals]
        return np.asarray(between & np.any(near, axis=0), np.bool_)


class OpenGates:
    """Whether all gates of an axis are open, from sample to sample."""

    def __init__(self, gates: Sequence[Gate]) -> None:
        self._gates = gates
        self._closed_us = np.full(len(gates), _LONG_AGO_US)
        """Time of the last sample at which each gate was closed by its signal [us]"""
        self._is_closed = [False] * len(gates)
        """Whether each was closed at the last sample"""

    def take(self, t_us: NDArray[np.int64], columns: Mapping[str, Floats]) -> Bools:
        """Whether all are open (N,) at these times [us], by the signals (N,) of these names."""
        every = np.ones(len(t_us), np.bool_)
        for k, gate in enumerate(self._gates):
            is_open = gate.open(columns[gate.signal])
            if gate.settle_s > 0 and len(t_us):
                latest = np.maximum.accumulate(np.where(is_open, -1, np.arange(len(t_us))))
                last_us = np.where(latest < 0, self._closed_us[k], t_us[latest])
                self._closed_us[k] = last_us[-1]
                is_open &= np.abs(t_us - last_us) > gate.settle_s * 1e6  # the clock may be set back
            if len(t_us):
                self._is_closed[k] = not is_open[-1]
            every &= is_open
        return every

    def closed(self, values: Mapping[str, float]) -> Iterator[str]:
        """Sentences that say which gates the last sample closed; its signals had these values."""
        for gate, closed in zip(self._gates, self._is_closed, strict=True):
            value = values[gate.signal]
            if closed and gate.open(np.array([value])).all():
                yield sentence(
                    "gate settles",
                    "{name} closed a gate less than {time} s ago",
                    name=gate.signal,
                    time=f"{gate.settle_s:g}",
                )
            elif closed:
                yield value_words(gate.signal, value)


def value_words(name: str, value: float) -> Sentence:
    """The value of a signal, or of a term of signals, as a sentence; NaN: it is not known."""
    if math.isnan(value):
        return sentence("not known", "{name} is not known", name=name)
    return sentence("value", "{name} = {value}", name=name, value=f"{value:g}")
