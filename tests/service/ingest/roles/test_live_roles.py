"""Times of receipt: the interval and the order of samples come out of frames that are late, lost, or in bunches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from monitor_core.arrays import Floats
from service.ingest.roles.live_roles import SignalSeries

H, COUNT = 0.005, 2000
TRUE = np.asarray(H * np.arange(COUNT), np.float64)


def on_time(t: Floats) -> Floats:
    return t


def in_bunches(t: Floats) -> Floats:
    """Every 20 ms, some of them later."""
    return np.asarray(np.ceil(t / 0.02) * 0.02 + 1e-5 * np.arange(t.size), np.float64)


def stalled(t: Floats) -> Floats:
    """Nothing for 0.4 s, five times; all that was held back comes at once."""
    late = t.copy()
    for begin in (0.0, 1.3, 4.0, 6.5, 9.0):
        held = (t >= begin) & (t < begin + 0.4)
        late[held] = begin + 0.4 + 1e-5 * np.arange(held.sum())
    return late


@pytest.mark.parametrize("received", [on_time, in_bunches, stalled, lambda t: stalled(in_bunches(t))])
def test_late_frames_are_even_samples(received: Callable[[Floats], Floats]) -> None:
    series = SignalSeries(received(TRUE), TRUE)
    assert series.interval_s == pytest.approx(H, rel=0.003)
    even = series.even_s
    assert np.ptp(even - TRUE) < 0.03


def test_after_a_loss_the_times_of_receipt_are_taken() -> None:
    kept = (TRUE < 4.0) | (TRUE > 4.5)
    series = SignalSeries(TRUE[kept], TRUE[kept])
    assert series.interval_s == pytest.approx(H, rel=1e-6)
    assert series.even_s is series.t
