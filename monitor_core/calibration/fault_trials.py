"""Faults injected at many onsets of a healthy record: when the CUSUM tests detect them, and under which name."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.calibration.injection import EquivalentLoad, changed_values, equivalent_load, faulty_torque
from monitor_core.calibration.simulated_copies import Plants, innovations
from monitor_core.detection import Crossing
from monitor_core.drive.assembly import Assembly
from monitor_core.drive.axis_model import AxisModel
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings

LANES = 64
PARTS = 40
"""Of the time that is watched; where all have alarmed, the rest is left out."""


@dataclass(frozen=True)
class Fault:
    """A change of a monitored parameter, as a share of its size."""

    parameter: str
    size: float


@dataclass(frozen=True)
class TrialResult:
    """Detection of one fault, at each onset.

    ``exact``: injected by the torque that the same motion would have needed; otherwise simulated with the identified
    model.  ``torque_peak``: the largest torque needed, where it is exact.
    """

    fault: Fault
    exact: bool
    delay_s: Floats  # (onsets,) until the first alarm, inf: none
    first: tuple[str, ...]  # (onsets,) whose alarm came first, "" for none
    direction: tuple[str, ...]  # (onsets,) "up", "down" or ""
    torque_peak: float

    def found_within(self, seconds: float) -> float:
        """Share of the onsets with an alarm within this time."""
        return float(np.mean(self.delay_s <= seconds))

    def delay(self, share: float) -> float:
        """Time within which this share of the onsets has an alarm; inf: not within the watched time."""
        ordered = np.sort(self.delay_s)
        return float(ordered[min(len(ordered) - 1, max(0, int(np.ceil(share * len(ordered))) - 1))])


def run_trials(
    model: AxisModel,
    settings: Settings,
    record: SampleBlock,
    faults: Sequence[Fault],
    onsets: int,
    seconds: float,
    progress: Callable[[float], None] = lambda _: None,
) -> tuple[list[TrialResult], int]:
    """Start each fault at ``onsets`` samples of the record and watch for ``within_s`` seconds.

    Returns the results, and the number of onsets that were possible.

    Raises:
        ValueError: the record is too short for that.
    """
    N = round(seconds / settings.interval_s)
    at = onset_samples(model, settings, record, onsets, N)
    columns = _healthy_states(model, settings, record, at)
    bank = AxisBatch([model] * LANES, [settings] * LANES)
    found = []
    for number, (fault, load, u, y) in enumerate(inject(model, settings, record, faults, at, N)):
        outcome = _first_alarms(bank, record, u, y, at, N, columns)
        found.append(_trial_result(fault, load, u, outcome, settings.interval_s))
        progress((number + 1) / len(faults))
    return found, len(at)


def onset_samples(model: AxisModel, settings: Settings, record: SampleBlock, onsets: int, N: int) -> Ints:
    """Samples of a record at which faults begin, each followed by at least N samples.

    Raises:
        ValueError: the record is too short for that.
    """
    first = _first_tested(AxisMonitor(model, settings), record)
    last = len(record.t_us) - N - 1
    if last <= first:
        raise ValueError("the record is too short")
    return np.unique(np.linspace(first, last, onsets).astype(np.int64))


def inject(
    model: AxisModel, settings: Settings, record: SampleBlock, faults: Sequence[Fault], at: Ints, N: int
) -> Iterator[tuple[Fault, EquivalentLoad | None, Floats, Floats | None]]:
    """Each fault, injected into the record.

    Yields the equivalent load of the fault where that is known exactly, with the torque of the whole record under it;
    otherwise the outputs (N, onsets) from each onset on.
    """
    states = innovations(model, settings, record, at.tolist())
    u_scale = Assembly(model.drive, model.monitored).model_constants(model, settings.speed_scale)["u_scale"]
    for fault in faults:
        values = changed_values(model, fault.parameter, fault.size)
        load = equivalent_load(model, values)
        if load is not None:
            yield fault, load, faulty_torque(model, settings, record, load, u_scale), None
        else:
            y = _faulty_outputs(model, settings, record, values, at, N, states.eps, states.x)
            yield fault, None, record.u, y


def _first_tested(monitor: AxisMonitor, record: SampleBlock) -> int:
    """First sample at which the tests run, some memories after the start."""
    st, step = monitor.batch.state, monitor.settings.span
    for k in range(0, len(record.t_us), step):
        part = record.select(slice(k, k + step))
        monitor.update(part)
        if not st.seed_left[0] and st.t[0] >= st.settled[0]:
            return min(k + step + round(3 * monitor.settings.memory), len(record.t_us))
    return len(record.t_us)


def _healthy_states(
    model: AxisModel, settings: Settings, record: SampleBlock, at: Ints
) -> list[tuple[Floats, Ints]]:
    """State of the healthy monitor just before each of these samples."""
    monitor, done, found = AxisMonitor(model, settings), 0, []
    for end in at.tolist():
        part = record.select(slice(done, end))
        monitor.update(part)
        found.append(monitor.batch.column(0))
        done = end
    return found


def _faulty_outputs(
    model: AxisModel,
    settings: Settings,
    record: SampleBlock,
    values: dict[str, float],
    at: Ints,
    N: int,
    eps: Floats,
    states: Floats,
) -> Floats:
    """Outputs (N, onsets) of the record, changed by the difference that the model predicts for the fault."""
    rows = np.arange(N)[:, np.newaxis] + at
    u, e = record.u[rows], np.nan_to_num(eps[rows])
    plants, W = Plants(model, settings, [model.nominal, values]), len(at)
    healthy, before = np.zeros(W, np.int64), record.u[at - 1]
    # Until the onset the previous torque acts, on the healthy drive.
    older = record.u[np.maximum(at - 2, 0)]
    _, x = plants.run(healthy, states, older, before[np.newaxis], np.zeros((1, W)))
    without, _ = plants.run(healthy, x, before, u, e)
    with_fault, _ = plants.run(healthy + 1, x, before, u, e)
    return np.asarray(record.y[rows] + with_fault - without)


def _first_alarms(
    bank: AxisBatch,
    record: SampleBlock,
    u: Floats,
    y: Floats | None,
    at: Ints,
    N: int,
    columns: Sequence[tuple[Floats, Ints]],
) -> list[Crossing | None]:
    """The first alarm after each onset."""
    found: list[Crossing | None] = [None] * len(at)
    for begin in range(0, len(at), LANES):
        onsets_now = at[begin : begin + LANES]
        lanes = np.minimum(np.arange(LANES), len(onsets_now) - 1)  # unused lanes repeat the last one
        rows = np.arange(N)[:, np.newaxis] + onsets_now[lanes]
        for a in range(LANES):
            bank.restore(a, *columns[begin + lanes[a]])
        outputs = record.y[rows] if y is None else y[:, begin + lanes]
        shift = None if record.shift is None else np.moveaxis(record.shift[rows], 1, 2)
        gate = None if record.gate is None else record.gate[rows]
        for part in np.array_split(np.arange(N), PARTS):
            for a, event in bank.run(
                record.t_us[rows[part]],
                u[rows[part]],
                outputs[part],
                shift=None if shift is None else shift[part],
                gate=None if gate is None else gate[part],
            ):
                if a < len(onsets_now) and found[begin + a] is None and isinstance(event, Crossing):
                    found[begin + a] = event
            if None not in found[begin : begin + len(onsets_now)]:
                break
    return [
        None if e is None else _relative_to_onset(e, record, int(k)) for e, k in zip(found, at, strict=True)
    ]


def _relative_to_onset(event: Crossing, record: SampleBlock, onset: int) -> Crossing:
    """The event with its time counted from the onset."""
    return Crossing(
        event.parameter,
        event.direction,
        event.time_us - int(record.t_us[onset]),
        0,
        event.size,
        event.size_sd,
    )


def _trial_result(
    fault: Fault,
    load: EquivalentLoad | None,
    u: Floats,
    outcome: Sequence[Crossing | None],
    interval_s: float,
) -> TrialResult:
    return TrialResult(
        fault,
        load is not None,
        np.array([np.inf if e is None else e.time_us * 1e-6 + interval_s for e in outcome]),
        tuple("" if e is None else e.parameter for e in outcome),
        tuple("" if e is None else e.direction for e in outcome),
        float(np.abs(u).max()) if load is not None else float("nan"),
    )
