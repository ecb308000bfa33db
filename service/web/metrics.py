"""Prometheus metrics from the newest snapshot.

prometheus_client writes the few general metrics.  The series of the axes, about seventy for each axis, are written
here: once for each snapshot, and only those metrics whose numbers have changed.
"""

import math
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import accumulate
from typing import Literal, NamedTuple

from prometheus_client import CollectorRegistry
from prometheus_client.core import HistogramMetricFamily, InfoMetricFamily, Metric
from prometheus_client.exposition import choose_encoder
from prometheus_client.process_collector import ProcessCollector
from prometheus_client.registry import Collector
from pydantic_core import to_json

from monitor_core.detection import DIRECTIONS, Reach
from monitor_core.monitoring import PRIORITIES, AlarmState
from service.pipeline.history_recording import OBSERVABILITY
from service.pipeline.snapshot import AxisSnapshot, LinkSnapshot, Snapshot
from service.web.app_state import VERSION, CachedAnswer, age_s, sample_age_s

_SI = "in the parameter's SI unit"
_PER_SECOND = "in the parameter's SI unit per second; absent until enough is known"
_GAUGES = {
    "axis parameter": {
        "parameter_estimate": f"Estimated value, {_SI}.",
        "parameter_nominal": f"Commissioned value, which may follow operating conditions, {_SI}.",
        "parameter_standard_deviation": f"Standard deviation, {_SI}.",
        "parameter_p_diagonal": "P_ii of the recursion; the variance of the estimate is lambda_0 P_ii / (1 + lambda).",
        "parameter_observed": "Observability of the parameter in the last samples: 1 as at commissioning, 0.5 weak, "
        "0 not observed; then the estimate is the last that was observed.",
        "parameter_tested": "1 while a change of the parameter would be found, else 0: "
        "the absence of an alarm then says nothing.",
        "cusum_threshold": f"Threshold h of both CUSUMs, {_SI} times samples.",
        "alarm_probability": "Probability that the parameter is the cause of a named open alarm, else 0.",
        "parameter_slope": f"Long-term drift, {_PER_SECOND}.",
        "parameter_slope_standard_deviation": f"Standard deviation of the long-term drift, {_PER_SECOND}.",
        "parameter_drift_probability": "Probability of a long-term drift of the parameter; absent until enough is "
        "known.",
    },
    "axis parameter direction": {
        "cusum": f"CUSUM g for an increase (up) and a decrease (down), {_SI} times samples.",
        "alarm_active": "1 while an alarm is open, waits for its off-delay or is latched, else 0.",
        "alarm_named": "1 while an alarm is open and has been named, else 0.",
        "alarm_hidden": "1 while all active alarms of that name are shelved, suppressed or out of service, else 0.",
    },
    "state priority": {
        "alarms": "Alarms by state and priority, except those that are over; those that are not yet recorded are "
        "counted, too."
    },
    "axis parameter limit bound": {
        "limit_reached_seconds": "Time from the last entry of the long-term history until a limit is reached, in "
        "seconds: lower (low) and upper (high) end of the 90 % interval; negative where it has been reached; no upper "
        "end where it is open."
    },
    "axis parameter limit": {
        "limit_alarm_active": "1 while an alarm is active because a limit will be reached soon, or has been, else 0."
    },
    "axis detector": {
        "detector_alarms": "1 for the detector that raises the alarms, 0 for one that runs in shadow mode.",
        "detector_evidence": "Largest test statistic of a detector, over its threshold.",
    },
    "axis": {
        "innovation_variance": "Running variance of the prediction error, in the square of the output's unit (rad or "
        "rad/s).",
        "axis_gated": "1 while operating conditions exclude the samples from estimation, else 0.",
        "axis_epoch": "Number of the epoch of the axis that is in force: of its nominal values and thresholds.",
        "axis_learning": "1 while a learning window of the axis runs, else 0.",
        "axis_out_of_service": "1 while the alarms of the axis are not announced, as it is maintained, else 0.",
        "axis_verifying": "1 while a new epoch of the axis is being verified, else 0.",
        "axis_heat_watts": "Friction power that would keep the axis as warm as it is, in watts; absent where nothing "
        "follows the heat of the axis.",
        "stamp_scatter_seconds": "Standard deviation of receipt time minus sample time, in seconds; where the receipt "
        "time is the sample time, that of the intervals divided by the square root of two.",
        "last_sample_age_seconds": "Time since the last sample, in seconds; +Inf before the first.",
    },
    "link": {
        "link_connected": "1 while the plant link works, 0 while its receiver cannot be reached.",
        "link_pending": "Transitions of alarms that wait for the link.",
    },
    "bus": {"bus_up": "1 while the bus can be read, else 0."},
    "use": {
        "certificate_expiry_seconds": "Time until the certificate of a server expires, or the first of its chain, in "
        "seconds; negative: it has. web: page, API and metrics; opcua: the OPC UA server."
    },
    "": {
        "alarms_not_recorded": "Alarms of which the journal does not have all yet, as the disk refuses it.",
        "history_waiting_points": "Points of the history that are not yet in its file.",
        "configuration_refused": "1 while a configuration is refused that SIGHUP was to load, and the former one stays "
        "in force, else 0.",
        "snapshot_age_seconds": "Time since the worker last reported, in seconds.",
        "checkpoint_age_seconds": "Time since the state of the monitors was last saved, in seconds; absent before the "
        "first time.",
    },
}
"""Help texts by labels and name; in the output a name starts with axiswatch_"""
_COUNTERS = {
    "axis": {
        "samples": "Samples received with the present nominal values, over restarts of the daemon.",
        "histories_lost": "Long-term histories that could not be restored at the start: damaged, or of another model.",
    },
    "axis parameter": {
        "parameter_tested_seconds": "Time for which the parameter has been tested with its present nominal "
        "values, over restarts of the daemon, in seconds."
    },
    "axis fate": {
        "samples_by_fate": "Samples by their use; starved: too little excitation; gated: excluded by operating "
        "conditions; projected: used, and an estimate was held within its bounds."
    },
    "axis reason": {"values_dropped": "Decoded values that did not become a sample."},
    "axis cause": {
        "clock_restarts": "Restarts of the time base of the samples: the controller restarted, or a clock was set."
    },
    "reason": {"history_dropped_points": "Points of the history that were dropped."},
    "link": {"link_delivered": "Transitions of alarms that the plant link has delivered."},
    "link reason": {
        "link_given_up": "Transitions of alarms that the plant link has given up: too old, or refused by the receiver."
    },
    "bus": {"frames": "Frames received."},
    "bus reason": {"frames_dropped": "Frames that were dropped."},
}


class Family(NamedTuple):
    """Type, help text and labels of a metric; in the output, the name of a counter ends with _total."""

    kind: Literal["gauge", "counter"]
    words: str
    labels: Sequence[str]


_KINDS: tuple[tuple[Literal["gauge", "counter"], dict[str, dict[str, str]]], ...] = (
    ("gauge", _GAUGES),
    ("counter", _COUNTERS),
)
FAMILIES = {
    name: Family(kind, words, labels.split())
    for kind, groups in _KINDS
    for labels, group in groups.items()
    for name, words in group.items()
}
"""The metrics of axes, alarms, buses and links, by name"""

_Labels = tuple[str, ...]
_NONE: Sequence[_Labels] = [()]
_Axes = tuple[AxisSnapshot, ...]


class Metrics:
    """Makes the answers of /metrics from the newest snapshot and the states of the plant links."""

    def __init__(
        self,
        snapshot: Callable[[], Snapshot],
        now_us: Callable[[], int],
        links: Callable[[], Sequence[LinkSnapshot]] = tuple,
    ) -> None:
        self._snapshot, self._now_us, self._links = snapshot, now_us, links
        self._small = CollectorRegistry()
        self._small.register(_Small(snapshot))
        ProcessCollector(registry=self._small)
        self._writers = {openmetrics: _Writer(openmetrics) for openmetrics in (False, True)}
        """Writers of ages and links; separate from those of the axes, which may be busy for long"""
        # Without ages: these must grow even while the worker hangs, as alert rules watch them.
        self.of_axes = {
            openmetrics: CachedAnswer(_Writer(openmetrics).of_axes, math.inf) for openmetrics in self._writers
        }

    def scrape(self, accept: str) -> tuple[bytes, str]:
        """Body and content type, in a format that the Accept header allows."""
        encoder, content_type = choose_encoder(accept)
        openmetrics = content_type.startswith("application/openmetrics-text")
        snapshot, now_us = self._snapshot(), self._now_us()
        fresh = self._writers[openmetrics].text([*_ages(snapshot, now_us), *_of_links(self._links())])
        return self.of_axes[openmetrics](snapshot, now_us) + fresh + encoder(self._small), content_type


class _Small(Collector):
    """Collects the metrics that are neither gauges nor counters."""

    def __init__(self, snapshot: Callable[[], Snapshot]) -> None:
        self._snapshot = snapshot

    def collect(self) -> Iterator[Metric]:
        """The metrics, from the newest snapshot."""
        yield InfoMetricFamily("axiswatch_build", "Version of axiswatch.", value={"version": VERSION})
        histogram = self._snapshot().processing
        bounds = [*(str(bound) for bound in histogram.bounds), "+Inf"]
        yield HistogramMetricFamily(
            "axiswatch_processing_seconds",
            "Time to process a block of samples, in seconds.",
            buckets=list(zip(bounds, accumulate(map(float, histogram.counts)), strict=True)),
            sum_value=histogram.total_s,
        )


class _Family(NamedTuple):
    """A metric: name without the prefix; label values and number of each series."""

    name: str
    labels: Sequence[_Labels]
    numbers: Sequence[float]


class _Lines:
    """The lines of a metric, cached: its series rarely change, and often its numbers do not change either."""

    def __init__(self, name: str, labels: Sequence[str]) -> None:
        self._name, self._labels = name, labels
        self._values: Sequence[_Labels] = []
        self._numbers: Sequence[float] = []
        self._form = self._text = ""

    def text(self, values: Sequence[_Labels], numbers: Sequence[float]) -> str:
        """A line for each series."""
        if values != self._values:
            self._form = "".join([f"{self._start(v)} %s\n" for v in values])
        elif numbers == self._numbers:
            return self._text
        self._values, self._numbers = values, numbers
        self._text = self._form % tuple(_written(numbers)) if numbers else ""
        return self._text

    def _start(self, values: Sequence[str]) -> str:
        pairs = sorted(zip(self._labels, map(_escaped, values), strict=True))
        inner = ",".join(f'{label}="{value}"' for label, value in pairs)
        return f"{self._name}{{{inner}}}" if pairs else self._name


class _Writer:
    """Writes gauges and counters in the text format or in OpenMetrics, which name counters differently."""

    def __init__(self, openmetrics: bool) -> None:
        self._openmetrics = openmetrics
        self._lines: dict[str, _Lines] = {}
        self._names = _Names(())
        self._lock = threading.Lock()

    def of_axes(self, snapshot: Snapshot, _now_us: int) -> bytes:
        """The lines of all metrics that depend only on the snapshot."""
        if not self._names.fit(snapshot.axes):
            self._names = _Names(snapshot.axes)
        return self.text(_of_axes(snapshot, self._names))

    def text(self, families: Iterable[_Family]) -> bytes:
        """The lines of families, from any thread."""
        parts = list[str]()
        with self._lock:
            for name, values, numbers in families:
                kind, words, labels = FAMILIES[name]
                total = "_total" if kind == "counter" else ""
                family = f"axiswatch_{name}{'' if self._openmetrics else total}"
                lines = self._lines.setdefault(name, _Lines(f"axiswatch_{name}{total}", labels))
                parts += (f"# HELP {family} {words}\n# TYPE {family} {kind}\n", lines.text(values, numbers))
        return "".join(parts).encode()


def _written(numbers: Iterable[float]) -> Sequence[str]:
    """Numbers with all digits, converted by JSON, which is much faster than Python; then infinities are replaced."""
    text = to_json([*map(float, numbers)], inf_nan_mode="constants").decode()
    return text[1:-1].replace("-Infinity", "-Inf").replace("Infinity", "+Inf").split(",")


def _escaped(value: str) -> str:
    """A label value, escaped for the metrics format and for a % template."""
    return value.replace("\\", r"\\").replace("\n", r"\n").replace('"', r"\"").replace("%", "%%")


class _Names:
    """Labels, cached while axes and parameters stay the same, as making them took a third of the time."""

    def __init__(self, axes: _Axes) -> None:
        self._of = self._read(axes)
        self.axes: list[_Labels] = [(axis.id,) for axis in axes]
        self.parameters: list[_Labels] = [(a.id, p.name) for a in axes for p in a.status.parameters]
        self.sides: list[_Labels] = [(*names, d) for names in self.parameters for d in DIRECTIONS]
        self.causes = [(axis.id, cause) for axis in axes for cause in axis.causes]
        self.alarms: list[_Labels] = [(*names, d) for names in self.causes for d in DIRECTIONS]
        self.detectors: list[_Labels] = [(a.id, d.name) for a in axes for d in a.status.detectors]
        self.fates: list[_Labels] = [(a.id, fate) for a in axes for fate in a.status.counters]

    def fit(self, axes: _Axes) -> bool:
        """Whether the labels fit these axes."""
        return self._of == self._read(axes)

    @staticmethod
    def _read(axes: _Axes) -> Sequence[object]:
        return (
            [axis.id for axis in axes],
            [axis.causes for axis in axes],
            [p.name for axis in axes for p in axis.status.parameters],
            [d.name for axis in axes for d in axis.status.detectors],
            [fate for axis in axes for fate in axis.status.counters],
        )


def _of_axes(snapshot: Snapshot, names: _Names) -> Iterator[_Family]:
    yield from _parameters(snapshot.axes, names)
    yield from _alarms(snapshot, names)
    yield from _life_cycle(snapshot, names)
    detectors = [d for a in snapshot.axes for d in a.status.detectors]
    yield _Family("detector_alarms", names.detectors, [d.alarms for d in detectors])
    yield _Family("detector_evidence", names.detectors, [d.evidence for d in detectors])
    yield from _samples(snapshot.axes, names)
    yield from _trends(snapshot.axes)
    yield from _buses(snapshot)
    yield _Family("configuration_refused", _NONE, [snapshot.configuration_refused])
    history = snapshot.history
    yield _Family("history_waiting_points", _NONE, [history.waiting])
    yield _Family("history_dropped_points", [(reason,) for reason in history.dropped], [*history.dropped.values()])


def _ages(snapshot: Snapshot, now_us: int) -> Iterator[_Family]:
    # +Inf before the first sample: the rule for a silent axis then also covers one that was never received.
    ages = [math.inf if (s := sample_age_s(a, now_us)) is None else s for a in snapshot.axes]
    yield _Family("last_sample_age_seconds", _ids(snapshot.axes), ages)
    yield _Family("snapshot_age_seconds", _NONE, [age_s(snapshot.taken_us, now_us)])
    saved = snapshot.checkpoint_us
    yield _Family("checkpoint_age_seconds", *(([], []) if saved is None else (_NONE, [age_s(saved, now_us)])))
    ends = snapshot.certificates
    left = [(end.at_us - now_us) / 1e6 for end in ends]
    yield _Family("certificate_expiry_seconds", [(end.use,) for end in ends], left)


def _ids(axes: _Axes) -> list[_Labels]:
    return [(axis.id,) for axis in axes]


def _by_reason(name: str, owners: Iterable[str], counts: Sequence[Mapping[str, int]]) -> _Family:
    labels = [(owner, reason) for owner, numbers in zip(owners, counts, strict=True) for reason in numbers]
    return _Family(name, labels, [n for numbers in counts for n in numbers.values()])


def _parameters(axes: _Axes, names: _Names) -> Iterator[_Family]:
    labels, known = names.parameters, [p for axis in axes for p in axis.status.parameters]
    yield _Family("parameter_estimate", labels, [p.estimate for p in known])
    yield _Family("parameter_nominal", labels, [p.nominal for p in known])
    yield _Family("parameter_standard_deviation", labels, [p.standard_deviation for p in known])
    yield _Family("parameter_p_diagonal", labels, [p.p_diagonal for p in known])
    yield _Family("parameter_observed", labels, [OBSERVABILITY[p.observation] for p in known])
    yield _Family("parameter_tested", labels, [p.tested for p in known])
    yield _Family("parameter_tested_seconds", labels, [p.tested_s for p in known])
    yield _Family("cusum", names.sides, [g for p in known for g in (p.g_up, p.g_down)])
    yield _Family("cusum_threshold", labels, [p.h for p in known])


def _alarms(snapshot: Snapshot, names: _Names) -> Iterator[_Family]:
    axes = snapshot.axes
    lasting = {  # ended, but latched or within the off-delay
        (a.axis, a.parameter, a.direction)
        for a in snapshot.alarms.standing
        if a.active and a.ended_us is not None and a.kind != "forecast"
    }
    # Forecasts have their own metric.
    alarms = [(a.id, e) for a in axes for e in a.open_alarms if e.kind != "forecast"]
    named = {(axis, e.parameter, e.direction) for axis, e in alarms if e.stage == "named"}
    active = lasting.union((axis, e.parameter, e.direction) for axis, e in alarms)
    yield _Family("alarm_active", names.alarms, [name in active for name in names.alarms])
    yield _Family("alarm_named", names.alarms, [name in named for name in names.alarms])
    probable = {(a.id, cause): p for a in axes if a.open_alarms for cause, p in _causes(a).items()}
    yield _Family("alarm_probability", names.causes, [probable.get(cause, 0.0) for cause in names.causes])


def _life_cycle(snapshot: Snapshot, names: _Names) -> Iterator[_Family]:
    """Alarms by state, hidden alarms, unrecorded alarms."""
    alarms = snapshot.alarms
    shown, hidden = set[_Labels](), set[_Labels]()
    for a in (*alarms.standing, *alarms.unrecorded):
        if a.active and a.kind != "forecast":
            kept = hidden if a.life.at(snapshot.taken_us).hidden else shown
            kept.add((a.axis, a.parameter, a.direction))
    hidden -= shown
    yield _Family("alarm_hidden", names.alarms, [name in hidden for name in names.alarms])
    counts = Counter({(str(c.state), str(c.priority)): c.alarms for c in alarms.states})
    counts.update((str(a.state), str(a.priority)) for a in alarms.unrecorded)
    places = [(str(s), str(p)) for s in AlarmState if s is not AlarmState.NORMAL for p in PRIORITIES]
    yield _Family("alarms", places, [counts[place] for place in places])
    yield _Family("alarms_not_recorded", _NONE, [alarms.waiting])


def _causes(axis: AxisSnapshot) -> dict[str, float]:
    """Probability of each cause; the largest one, if several alarms name it."""
    found: dict[str, float] = {}
    for e in axis.open_alarms:
        for name, probability, _ in e.causes:
            found[name] = max(found.get(name, 0.0), probability)
    return found


def _samples(axes: _Axes, names: _Names) -> Iterator[_Family]:
    ids, owners = names.axes, [a.id for a in axes]
    yield _Family("innovation_variance", ids, [a.status.innovation_variance for a in axes])
    yield _Family("axis_gated", ids, [bool(a.gated_by) for a in axes])
    yield _Family("axis_epoch", ids, [a.epoch.number for a in axes])
    yield _Family("axis_learning", ids, [a.epoch.state == "learning" for a in axes])
    yield _Family("axis_out_of_service", ids, [a.out_of_service is not None for a in axes])
    yield _Family("axis_verifying", ids, [a.epoch.state == "verifying" for a in axes])
    heats = [(a.id, a.heat) for a in axes if a.heat is not None]
    yield _Family("axis_heat_watts", [(axis,) for axis, _ in heats], [heat.heat_w for _, heat in heats])
    yield _Family("samples", ids, [a.status.samples for a in axes])
    yield _Family("samples_by_fate", names.fates, [n for a in axes for n in a.status.counters.values()])
    yield _by_reason("values_dropped", owners, [a.dropped for a in axes])
    yield _by_reason("clock_restarts", owners, [a.clock for a in axes])
    scatters = [(a.id, s) for a in axes if (s := a.stamps.scatter_s) is not None]
    yield _Family("stamp_scatter_seconds", [(axis,) for axis, _ in scatters], [s for _, s in scatters])


def _trends(axes: _Axes) -> Iterator[_Family]:
    """Slopes with standard deviations, probabilities of a drift, and times at which limits are reached."""
    known = [(a, p, p.trend) for a in axes for p in a.trends if p.trend is not None]
    labels, trends = [(a.id, p.name) for a, p, _ in known], [t for *_, t in known]
    yield _Family("parameter_slope", labels, [t.slope for t in trends])
    yield _Family("parameter_slope_standard_deviation", labels, [t.slope_sd for t in trends])
    probability = [t.probability["drift"] + t.probability["both"] for t in trends]
    yield _Family("parameter_drift_probability", labels, probability)
    reaches = [((a.id, r.name, "upper" if r.above else "lower"), a, p, t, r) for a, p, t in known for r in p.reaches]
    ends = [
        ((*limit, bound), (t_us - t.time_us) / 1e6)
        for limit, _, _, t, r in reaches
        for bound, t_us in (("low", r.low_us), ("high", r.high_us))
        if t_us is not None
    ]
    yield _Family("limit_reached_seconds", [end for end, _ in ends], [s for _, s in ends])
    limits = [limit for limit, *_ in reaches]
    yield _Family("limit_alarm_active", limits, [_is_limit_alarm_open(a, p.name, r) for _, a, p, _, r in reaches])
    yield _Family("histories_lost", _ids(axes), [a.histories_lost for a in axes])


def _is_limit_alarm_open(axis: AxisSnapshot, parameter: str, reach: Reach) -> bool:
    return any(
        (limit.name, limit.above) == (reach.name, reach.above)
        for e in axis.open_alarms
        if e.kind == "forecast" and e.parameter == parameter
        for limit in e.reaches
    )


def _buses(snapshot: Snapshot) -> Iterator[_Family]:
    buses, names = snapshot.buses, [(b.name,) for b in snapshot.buses]
    yield _Family("bus_up", names, [b.up for b in buses])
    yield _Family("frames", names, [b.frames for b in buses])
    yield _by_reason("frames_dropped", [b.name for b in buses], [b.dropped for b in buses])


def _of_links(links: Sequence[LinkSnapshot]) -> Iterator[_Family]:
    names = [(link.name,) for link in links]
    yield _Family("link_connected", names, [link.connected for link in links])
    yield _Family("link_pending", names, [link.pending for link in links])
    yield _Family("link_delivered", names, [link.delivered for link in links])
    yield _by_reason("link_given_up", [link.name for link in links], [link.given_up for link in links])
