"""The clock of a controller, which gives samples their times: by a sample counter on the bus, or by its cycle.

The times depend only on counts and times of receipt, so a replay gives the same times.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.sampling.clock_line import DRIFT_FIELDS, LINE_FIELDS, new_line

GIVEN, REPEATED, OUT_OF_ORDER, UNTIMED = -1, 2, 3, 4
"""Result for a frame: it has a time, or the reason why it has none, as an index of ``DROP_REASONS``."""

CLOCK = np.dtype(
    [
        *LINE_FIELDS,
        *DRIFT_FIELDS,
        ("modulus", "i8"),  # of a counter: 2^bits
        ("offset", "f8"),  # of a counter: of its values
        ("longest", "i8"),  # cycles in tolerance_us: so far back may a frame be, and so many are held
        ("runs", "?"),  # whether the line has begun
        ("n", "i8"),  # sample number of the last frame, or last cycle that has a time
        ("given_n", "i8"),  # of a counter: last number that has a time
        ("raw", "i8"),  # of a counter: value in the last frame, wrapped
        ("received_us", "i8"),  # time of receipt of the last frame
        ("held", "i8"),  # number of values in the row HELD
        ("ready", "i8"),  # number of values in the row READY
        ("paused", "?"),  # whether a held frame came after a pause, so that the clock may have been set
        ("pauses", "i8"),  # number of such pauses: after each the phase of the line is new
        ("bunched", "f8"),  # share of the frames that follow another one immediately
        ("set_back", "?"),  # the last frame may be the first one after this machine's clock was set back
        ("set_back_us", "f8"),  # its delay, if it belongs to the next cycle
    ]
)
"""A line with its drift, and the data of the last frame."""

VALUE = np.dtype(
    [
        ("place", "i8"),  # in its block
        ("received_us", "i8"),
        ("cycle", "i8"),  # last cycle that the frame can belong to
        ("torque", "f8"),
        ("motion", "f8"),
        ("has_torque", "?"),
        ("has_motion", "?"),
        ("time_us", "i8"),  # while it is held: its cycle
        ("reason", "i8"),  # GIVEN, or why it has no time
    ]
)
"""The values of a frame, and the time found for it."""

HELD, READY = 0, 1
"""Rows of ``Clock.values``: values whose cycle is not known yet; values that just got a time, or a reason for none"""


class Clock(NamedTuple):
    """A clock, and the values of frames that wait for their time."""

    state: NDArray[np.void]
    """(1,)"""
    values: NDArray[np.void]
    """(2, W) HELD and READY"""

    @property
    def reanchored(self) -> int:
        """How often the line, or its phase, was restarted."""
        return int(self.state["restarts"][0] + self.state["pauses"][0])


def new_clock(interval_s: float, keep: int, most: int, held: int) -> Clock:
    """A clock before its first frame.

    Args:
        interval_s: the time of one count or cycle [s].
        keep: number of windows through which the line is fitted.
        most: number of the earliest frames of a window that are kept.
        held: 1 if frames wait for their times, else 0.
    """
    state = np.zeros(1, CLOCK)
    new_line(state, interval_s)
    state["keep"], state["most"] = keep, most
    state["longest"] = longest = math.ceil(state["tolerance_us"][0] / state["interval_us"][0])
    return Clock(state, np.zeros((2, held * longest + 3), VALUE))
