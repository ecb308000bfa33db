"""Every version of every alarm, where a test follows an alarm from its first crossing to its end."""

from __future__ import annotations

from monitor_core.detection import Alarm
from monitor_core.kernel.block import Trace
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock


def alarm_versions(monitor: AxisMonitor, samples: SampleBlock) -> tuple[list[Alarm], Trace]:
    """As ``update_traced`` of a monitor that alarms by its CUSUM tests, with the alarm after each of its events."""
    shift = None if samples.shift is None else samples.shift[..., None]
    gate = None if samples.gate is None else samples.gate[..., None]
    t_us, u, y = samples.t_us[:, None], samples.u[:, None], samples.y[:, None]
    events, trace = monitor.batch.run_traced(t_us, u, y, shift=shift, gate=gate)
    versions = [change.alarm for _, event in events for change in monitor.apply([event])]
    return versions, Trace(*(field[..., 0] for field in trace))
