"""All that is reported of faults: every version of every alarm, and outcomes over the reference experiment."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.detection import Alarm
from monitor_core.excitation.reference_experiment import FAULT_AT, experiments
from monitor_core.kernel.block import Trace
from monitor_core.modeling.standard_drives import reference_model
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from tests.core.figures import settings_of

MODEL = reference_model()
FAULTS = [(name, factor) for name in MODEL.monitored for factor in (1.2, 0.8)]
SAMPLES = 4000
H_US = 5000
Bools = NDArray[np.bool_]


def histories(
    seed: int, t_us: Sequence[int], u: Floats, y: Floats, joint: bool = False
) -> tuple[list[list[Alarm]], list[AxisMonitor]]:
    """Every version of every alarm of each axis, a column of ``u`` and ``y``; and its monitor."""
    W = u.shape[1]
    settings = replace(settings_of("speed", seed), joint_state=joint)
    batch = AxisBatch([MODEL] * W, [settings] * W)
    monitors = [AxisMonitor.of_lane(batch, a) for a in range(W)]
    versions: list[list[Alarm]] = [[] for _ in monitors]
    for a, event in batch.run(np.repeat(np.array(t_us)[:, np.newaxis], W, axis=1), u, y):
        versions[a] += [change.alarm for change in monitors[a].apply([event])]
    return versions, monitors


def first_named(versions: Sequence[Alarm]) -> Alarm | None:
    return next((e for e in versions if e.stage == "named"), None)


def alarm_versions(monitor: AxisMonitor, samples: SampleBlock) -> tuple[list[Alarm], Trace]:
    """As ``update_traced`` of a monitor that alarms by its CUSUM tests, with the alarm after each of its events."""
    shift = None if samples.shift is None else samples.shift[..., None]
    gate = None if samples.gate is None else samples.gate[..., None]
    t_us, u, y = samples.t_us[:, None], samples.u[:, None], samples.y[:, None]
    events, trace = monitor.batch.run_traced(t_us, u, y, shift=shift, gate=gate)
    versions = [change.alarm for _, event in events for change in monitor.apply([event])]
    return versions, Trace(*(field[..., 0] for field in trace))


class Outcomes(NamedTuple):
    """What was reported of faults: an array over all of them, over those named, or over those named right."""

    found: Bools
    named: Bools
    right: Bools  # of those named
    crossed: Bools  # of those named: the right one crossed first
    onset: Bools  # of those right, with an onset: its 90 % interval holds the fault
    z: Floats  # of those right: error of the size over its standard deviation
    kind: NDArray[np.str_]  # of those right

    @classmethod
    def joined(cls, several: Iterable["Outcomes"]) -> "Outcomes":
        return cls(*map(np.concatenate, zip(*several, strict=True)))

    @property
    def size(self) -> Bools:
        """Whether the size is within 90 %."""
        return np.abs(self.z) < 1.645


def outcomes(name: str, factor: float, each: int, seed: int, joint: bool = False) -> Outcomes:
    """Outcomes of ``each`` records of the reference experiment in which the parameter changes by the factor."""
    t_us, u, y = experiments(range(seed, seed + each), {name: factor}, samples=SAMPLES)
    versions, _ = histories(seed, t_us.tolist(), u, y, joint)
    after = [[e for e in episodes if e.raised_us >= FAULT_AT * H_US] for episodes in versions]
    named = [e for episodes in after if (e := first_named(episodes)) is not None]
    right = [e for e in named if e.parameter == name]
    size = (factor - 1) * MODEL.theta0[MODEL.monitored.index(name)]
    return Outcomes(
        np.array([bool(episodes) for episodes in after]),
        np.array([first_named(episodes) is not None for episodes in after]),
        np.array([e.parameter == name for e in named]),
        np.array([e.first[0] == name for e in named]),
        np.array([(e.onset_low_us or 0) <= FAULT_AT * H_US <= e.onset_high_us for e in right if e.onset_high_us]),
        np.array([(e.size - size) / e.size_sd for e in right]),
        np.array([e.kind for e in right]),
    )
