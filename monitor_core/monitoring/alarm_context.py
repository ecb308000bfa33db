"""The circumstances of an alarm: whether it was raised in the conditions of the calibration, and what looks like it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from monitor_core.detection.alarm import Alarm
from monitor_core.kernel.state import NEVER
from monitor_core.samples import SampleBlock

E = TypeVar("E")
Interpret = Callable[[E, Sequence[Alarm]], Iterable[Alarm]]
"""The alarms that an event of a detector makes of the open ones."""


def in_context(
    interpret: Interpret[E], samples: SampleBlock | None, look_alike: Mapping[str, str]
) -> Interpret[E]:
    """As ``interpret``, with alarms that state their circumstances.

    Args:
        interpret: of a detector.
        samples: those of the events; None, or without ``inside``: nothing is known of the calibration.
        look_alike: what else a change of a parameter may be, by its name.
    """
    if (samples is None or samples.inside is None) and not look_alike:
        return interpret

    def stated(event: E, open_alarms: Sequence[Alarm]) -> Iterator[Alarm]:
        before = {alarm.key for alarm in open_alarms}
        for alarm in interpret(event, open_alarms):
            if samples is not None and alarm.key not in before and alarm.inside_calibration is None:
                alarm = replace(alarm, inside_calibration=_inside(samples, alarm.raised_us))
            yield _with_alike(alarm, look_alike) if look_alike else alarm

    return stated


def _inside(samples: SampleBlock, t_us: int) -> bool | None:
    """Whether the conditions at that time were those of the calibration; None: not known."""
    at = np.flatnonzero(samples.t_us == t_us)
    return bool(samples.inside[at[0]]) if samples.inside is not None and at.size else None


def _with_alike(alarm: Alarm, look_alike: Mapping[str, str]) -> Alarm:
    causes = (
        cause._replace(alike=(*cause.alike, look_alike[cause.parameter]))
        if cause.parameter in look_alike and look_alike[cause.parameter] not in cause.alike
        else cause
        for cause in alarm.causes
    )
    return replace(alarm, causes=tuple(causes))


def last_open_us(samples: SampleBlock) -> int:
    """Time of the last sample that no gate leaves out, and whose conditions are known [us]; NEVER: none."""
    is_open = np.ones(samples.size, np.bool_) if samples.gate is None else samples.gate
    if samples.shift is not None:
        is_open = is_open & np.isfinite(samples.shift).all(axis=1)
    return int(samples.t_us[is_open][-1]) if is_open.any() else NEVER
