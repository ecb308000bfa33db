"""Starts of the motion at a heat that the records of an axis do not show.

In the morning the friction of a robot is 20 to 80 % above that of the warm robot, and it falls for an hour or two.
Without a thermometer or a thermal law, nothing says what friction to expect.  Then a change of friction that begins
with the motion, or a slow fall of friction in the hours after it, may come from heat or from a fault.  Depending on the
configuration, its alarm is raised and names both, or the axis is not tested for an hour.  A change of friction while
the axis works does not come from heat.
"""

from collections import deque
from collections.abc import Mapping
from itertools import takewhile

import numpy as np

from monitor_core.arrays import Arrays
from monitor_core.detection.alarm import Alarm
from monitor_core.drive.friction_roles import friction_of
from monitor_core.monitoring.axis_monitor import AxisMonitor
from monitor_core.samples import SampleBlock

PAUSE_S = 600.0
"""After a shorter standstill an axis is about as warm as before it: gearboxes cool with time constants of
some 5 and 25 minutes."""
WARM_S = 7200.0
"""Time [s] after a start at which an axis is as warm as it becomes: five of the slow time constants."""
ONSET_MEMORIES = 4
"""Memories after the start of the tests, within which a change has its onset if it was there at the start."""
LOOKS_PER_MEMORY = 2
"""Number of times per memory at which it is judged whether the axis moves."""
WAIT_S = 3600.0
"""Time [s] for which an axis waits after a start, if it waits: a tenth of a cold start's friction is left then."""
MAX_STARTS = 16
"""Number of starts that are remembered, for alarms that are open meanwhile."""
OTHER_HEAT = "a gearbox that starts colder or warmer than in its records"
WARMER = "a gearbox that becomes warmer than in its records"


class UnrecordedHeat:
    """The starts of one axis, and the alarms that may be due to its heat.

    Args:
        monitor: the monitor that gets the samples; its saved state is restored before the first part.
        waits: whether the axis is not tested for an hour after a start.
    """

    def __init__(self, monitor: AxisMonitor, waits: bool = False) -> None:
        self._monitor, friction, s = monitor, friction_of(monitor.model.drive), monitor.settings
        self._friction = (*friction.viscous, *friction.coulomb)
        self._memory_us = max(LOOKS_PER_MEMORY, round(1e6 * s.memory * s.interval_s))
        self._every_us = self._memory_us // LOOKS_PER_MEMORY
        self._begun = False
        self._last_us: int | None = None  # the last sample
        self._moved = 0  # the monitor's count of samples with motion, at the last look
        self._moved_us: int | None = None  # the last sample with motion
        self._starts = deque[int](maxlen=MAX_STARTS)  # times [us], the oldest first
        self._waits, self._stands = waits, False
        monitor.look_alike = self.look_alike

    def part(self, block: SampleBlock) -> tuple[SampleBlock, SampleBlock | None]:
        """The next part of a block for the monitor, and the remaining samples or None.

        The monitor must take the part before the next call.  The parts depend on the times of the samples only.
        """
        if not block.size:
            return block, None
        if not self._begun:  # by now, a saved state of the monitor has been restored
            self._begin()
        look, now_us = block.t_us // self._every_us, int(block.t_us[0])
        if self._last_us is None or look[0] != self._last_us // self._every_us:
            self._follow(now_us)
        later = np.flatnonzero(look != look[0])
        n = int(later[0]) if later.size else block.size
        self._last_us = int(block.t_us[n - 1])
        return block.select(slice(n)), block.select(slice(n, None)) if n < block.size else None

    def _begin(self) -> None:
        """Go on from the state of the monitor.  A monitor without a sample has an axis at an unknown heat."""
        m = self._monitor
        self._begun, self._last_us, self._moved = True, m.time_us, m.moved
        if self._moved_us is None and m.moved:  # saved by a version that did not save the motion
            self._moved_us = m.time_us

    def _follow(self, now_us: int) -> None:
        """Find out whether the axis has moved since the last call, and whether a motion starts now."""
        if self._monitor.moved != self._moved:
            self._moved, self._moved_us, self._stands = self._monitor.moved, self._last_us, False
        pauses = self._moved_us is None or abs(now_us - self._moved_us) > PAUSE_S * 1e6
        if pauses and not self._stands:
            self._starts.append(now_us)
        elif self._starts and (self._stands or not self._tested):
            self._starts[-1] = now_us
        self._stands = pauses
        if self._waits:
            self._wait(now_us)

    def _wait(self, now_us: int) -> None:
        """Do not test the axis while it waits."""
        until_us = self._starts[-1] + round(WAIT_S * 1e6) if self._starts else now_us
        self._monitor.waits = now_us < until_us
        self._monitor.judged_us = until_us if self._monitor.waits else None
        self._monitor.judge(not self._monitor.waits)

    @property
    def _tested(self) -> bool:
        """Whether the tests have begun: those of the estimates begin when P(0) is found."""
        return self._monitor.alarm_source == "multimodel" or self._monitor.deviations() is not None

    def to_arrays(self) -> Arrays | None:
        """The state to save, as arrays by name; None: there is no state yet."""
        moved_us = self._moved_us if self._monitor.moved == self._moved else self._last_us
        if moved_us is None:
            return None
        return {
            "starts": np.array(self._starts, np.int64),
            "moved": np.array([moved_us, self._stands], np.int64),
        }

    def from_arrays(self, arrays: Arrays) -> None:
        """Restore a saved state, before the first part.

        Raises:
            KeyError: an array is missing.
            ValueError: an array does not have the form of such a state.
        """
        starts, moved = np.asarray(arrays["starts"]), np.asarray(arrays["moved"])
        if any(a.dtype != np.int64 or a.ndim != 1 for a in (starts, moved)) or moved.size != 2:
            raise ValueError("these are no starts of a motion")
        self._starts.extend(map(int, starts))
        self._moved_us, self._stands = int(moved[0]), bool(moved[1])

    def look_alike(self, alarm: Alarm) -> Mapping[str, str] | None:
        """Heat as another cause of this alarm, by the name of the friction parameter; None: no longer known."""
        start_us = max(takewhile(lambda start_us: start_us <= alarm.raised_us, self._starts), default=None)
        if start_us is None:
            return None
        onset_us = alarm.onset_us if alarm.onset_low_us is None else alarm.onset_low_us
        if onset_us - start_us <= ONSET_MEMORIES * self._memory_us:
            return dict.fromkeys(self._friction, OTHER_HEAT)
        falls = alarm.kind == "drift" and alarm.direction == "down"
        if falls and onset_us - start_us <= WARM_S * 1e6:
            return dict.fromkeys(self._friction, WARMER)
        return {}
