"""All that is said of a fault: every version of every alarm, and of the faults of the reference experiment."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.detection import Alarm
from monitor_core.kernel.block import Trace
from monitor_core.modeling.standard_drives import reference_model
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from tests.core.figures import settings_of

MODEL = reference_model()
FAULTS = [(name, factor) for name in MODEL.monitored for factor in (1.2, 0.8)]
SEEDS, SAMPLES = 24, 4000
H_US = 5000


def histories(
    seed: int, t_us: Sequence[int], u: Floats, y: Floats, joint: bool = False
) -> tuple[list[list[Alarm]], list[AxisMonitor]]:
    """Everything each axis, a column, said; and its monitor."""
    W = u.shape[1]
    settings = replace(settings_of("speed", seed), joint_state=joint)
    bank = AxisBatch([MODEL] * W, [settings] * W)
    monitors = [AxisMonitor.of_lane(bank, a) for a in range(W)]
    said: list[list[Alarm]] = [[] for _ in monitors]
    for a, event in bank.run(np.repeat(np.array(t_us)[:, np.newaxis], W, axis=1), u, y):
        said[a] += [change.alarm for change in monitors[a].apply([event])]
    return said, monitors


def first_named(said: Sequence[Alarm]) -> Alarm | None:
    return next((e for e in said if e.stage == "named"), None)


def alarm_versions(monitor: AxisMonitor, samples: SampleBlock) -> tuple[list[Alarm], Trace]:
    """As ``update_traced`` of a monitor that alarms by its CUSUM tests, with the alarm after each of its events."""
    shift = None if samples.shift is None else samples.shift[..., None]
    gate = None if samples.gate is None else samples.gate[..., None]
    t_us, u, y = samples.t_us[:, None], samples.u[:, None], samples.y[:, None]
    events, trace = monitor.batch.run_traced(t_us, u, y, shift=shift, gate=gate)
    versions = [change.alarm for _, event in events for change in monitor.apply([event])]
    return versions, Trace(*(field[..., 0] for field in trace))
