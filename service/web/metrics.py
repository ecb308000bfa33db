"""Prometheus metrics from the newest snapshot.

prometheus_client writes the few general metrics.  The many series of the axes are written by ``metrics_text``, once for
each snapshot.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import accumulate

from prometheus_client import CollectorRegistry
from prometheus_client.core import HistogramMetricFamily, InfoMetricFamily, Metric
from prometheus_client.exposition import choose_encoder
from prometheus_client.process_collector import ProcessCollector
from prometheus_client.registry import Collector

from monitor_core.detection import DIRECTIONS, Reach
from monitor_core.monitoring import PRIORITIES, AlarmState
from service.pipeline.persistence.history_recording import OBSERVABILITY
from service.pipeline.snapshot import AxisSnapshot, LinkSnapshot, Snapshot
from service.web.app_state import VERSION, CachedAnswer, age_s, sample_age_s
from service.web.metrics_text import Labels, MetricSeries, MetricsWriter

_NONE: Sequence[Labels] = [()]
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
        self._writers = {openmetrics: MetricsWriter(openmetrics) for openmetrics in (False, True)}
        """Writers of ages and links; separate from those of the axes, which may be busy for long"""
        # Without ages: these must grow even while the worker hangs, as alert rules watch them.
        self.of_axes = {
            openmetrics: CachedAnswer(_AxesWriter(openmetrics).text, math.inf) for openmetrics in self._writers
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


class _AxesWriter:
    """Writes all metrics that depend only on the snapshot, with labels that are kept while the axes stay the same."""

    def __init__(self, openmetrics: bool) -> None:
        self._writer = MetricsWriter(openmetrics)
        self._names = _Names(())

    def text(self, snapshot: Snapshot, _now_us: int) -> bytes:
        """The lines of a snapshot."""
        if not self._names.fit(snapshot.axes):
            self._names = _Names(snapshot.axes)
        return self._writer.text(_of_axes(snapshot, self._names))


class _Names:
    """Labels, cached while axes and parameters stay the same, as making them took a third of the time."""

    def __init__(self, axes: _Axes) -> None:
        self._of = self._read(axes)
        self.axes: list[Labels] = [(axis.id,) for axis in axes]
        self.parameters: list[Labels] = [(a.id, p.name) for a in axes for p in a.status.parameters]
        self.sides: list[Labels] = [(*names, d) for names in self.parameters for d in DIRECTIONS]
        self.causes = [(axis.id, cause) for axis in axes for cause in axis.causes]
        self.alarms: list[Labels] = [(*names, d) for names in self.causes for d in DIRECTIONS]
        self.detectors: list[Labels] = [(a.id, d.name) for a in axes for d in a.status.detectors]
        self.fates: list[Labels] = [(a.id, fate) for a in axes for fate in a.status.counters]

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


def _of_axes(snapshot: Snapshot, names: _Names) -> Iterator[MetricSeries]:
    yield from _parameters(snapshot.axes, names)
    yield from _alarms(snapshot, names)
    yield from _life_cycle(snapshot, names)
    detectors = [d for a in snapshot.axes for d in a.status.detectors]
    yield MetricSeries("detector_alarms", names.detectors, [d.alarms for d in detectors])
    yield MetricSeries("detector_evidence", names.detectors, [d.evidence for d in detectors])
    yield from _samples(snapshot.axes, names)
    yield from _trends(snapshot.axes)
    yield from _buses(snapshot)
    yield MetricSeries("configuration_refused", _NONE, [snapshot.configuration_refused])
    history = snapshot.history
    yield MetricSeries("history_waiting_points", _NONE, [history.waiting])
    yield MetricSeries("history_dropped_points", [(reason,) for reason in history.dropped], [*history.dropped.values()])


def _ages(snapshot: Snapshot, now_us: int) -> Iterator[MetricSeries]:
    # +Inf before the first sample: the rule for a silent axis then also covers one that was never received.
    ages = [math.inf if (s := sample_age_s(a, now_us)) is None else s for a in snapshot.axes]
    yield MetricSeries("last_sample_age_seconds", _ids(snapshot.axes), ages)
    yield MetricSeries("snapshot_age_seconds", _NONE, [age_s(snapshot.taken_us, now_us)])
    saved = snapshot.checkpoint_us
    yield MetricSeries("checkpoint_age_seconds", *(([], []) if saved is None else (_NONE, [age_s(saved, now_us)])))
    ends = snapshot.certificates
    left = [(end.at_us - now_us) / 1e6 for end in ends]
    yield MetricSeries("certificate_expiry_seconds", [(end.use,) for end in ends], left)


def _ids(axes: _Axes) -> list[Labels]:
    return [(axis.id,) for axis in axes]


def _by_reason(name: str, owners: Iterable[str], counts: Sequence[Mapping[str, int]]) -> MetricSeries:
    labels = [(owner, reason) for owner, numbers in zip(owners, counts, strict=True) for reason in numbers]
    return MetricSeries(name, labels, [n for numbers in counts for n in numbers.values()])


def _parameters(axes: _Axes, names: _Names) -> Iterator[MetricSeries]:
    labels, known = names.parameters, [p for axis in axes for p in axis.status.parameters]
    yield MetricSeries("parameter_estimate", labels, [p.estimate for p in known])
    yield MetricSeries("parameter_nominal", labels, [p.nominal for p in known])
    yield MetricSeries("parameter_standard_deviation", labels, [p.standard_deviation for p in known])
    yield MetricSeries("parameter_p_diagonal", labels, [p.p_diagonal for p in known])
    yield MetricSeries("parameter_observed", labels, [OBSERVABILITY[p.observation] for p in known])
    yield MetricSeries("parameter_tested", labels, [p.tested for p in known])
    yield MetricSeries("parameter_tested_seconds", labels, [p.tested_s for p in known])
    yield MetricSeries("cusum", names.sides, [g for p in known for g in (p.g_up, p.g_down)])
    yield MetricSeries("cusum_threshold", labels, [p.h for p in known])


def _alarms(snapshot: Snapshot, names: _Names) -> Iterator[MetricSeries]:
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
    yield MetricSeries("alarm_active", names.alarms, [name in active for name in names.alarms])
    yield MetricSeries("alarm_named", names.alarms, [name in named for name in names.alarms])
    probable = {(a.id, cause): p for a in axes if a.open_alarms for cause, p in _causes(a).items()}
    yield MetricSeries("alarm_probability", names.causes, [probable.get(cause, 0.0) for cause in names.causes])


def _life_cycle(snapshot: Snapshot, names: _Names) -> Iterator[MetricSeries]:
    """Alarms by state, hidden alarms, unrecorded alarms."""
    alarms = snapshot.alarms
    shown, hidden = set[Labels](), set[Labels]()
    for a in (*alarms.standing, *alarms.unrecorded):
        if a.active and a.kind != "forecast":
            kept = hidden if a.life.at(snapshot.taken_us).hidden else shown
            kept.add((a.axis, a.parameter, a.direction))
    hidden -= shown
    yield MetricSeries("alarm_hidden", names.alarms, [name in hidden for name in names.alarms])
    counts = Counter({(str(c.state), str(c.priority)): c.alarms for c in alarms.states})
    counts.update((str(a.state), str(a.priority)) for a in alarms.unrecorded)
    places = [(str(s), str(p)) for s in AlarmState if s is not AlarmState.NORMAL for p in PRIORITIES]
    yield MetricSeries("alarms", places, [counts[place] for place in places])
    yield MetricSeries("alarms_not_recorded", _NONE, [alarms.waiting])


def _causes(axis: AxisSnapshot) -> dict[str, float]:
    """Probability of each cause; the largest one, if several alarms name it."""
    found: dict[str, float] = {}
    for e in axis.open_alarms:
        for name, probability, _ in e.causes:
            found[name] = max(found.get(name, 0.0), probability)
    return found


def _samples(axes: _Axes, names: _Names) -> Iterator[MetricSeries]:
    ids, owners = names.axes, [a.id for a in axes]
    yield MetricSeries("innovation_variance", ids, [a.status.innovation_variance for a in axes])
    yield MetricSeries("axis_gated", ids, [bool(a.gated_by) for a in axes])
    yield MetricSeries("axis_epoch", ids, [a.epoch.number for a in axes])
    yield MetricSeries("axis_learning", ids, [a.epoch.state == "learning" for a in axes])
    yield MetricSeries("axis_out_of_service", ids, [a.out_of_service is not None for a in axes])
    yield MetricSeries("axis_verifying", ids, [a.epoch.state == "verifying" for a in axes])
    heats = [(a.id, a.heat) for a in axes if a.heat is not None]
    yield MetricSeries("axis_heat_watts", [(axis,) for axis, _ in heats], [heat.heat_w for _, heat in heats])
    yield MetricSeries("samples", ids, [a.status.samples for a in axes])
    yield MetricSeries("samples_by_fate", names.fates, [n for a in axes for n in a.status.counters.values()])
    yield _by_reason("values_dropped", owners, [a.dropped for a in axes])
    yield _by_reason("clock_restarts", owners, [a.clock for a in axes])
    scatters = [(a.id, s) for a in axes if (s := a.stamps.scatter_s) is not None]
    yield MetricSeries("stamp_scatter_seconds", [(axis,) for axis, _ in scatters], [s for _, s in scatters])


def _trends(axes: _Axes) -> Iterator[MetricSeries]:
    """Slopes with standard deviations, probabilities of a drift, and times at which limits are reached."""
    known = [(a, p, p.trend) for a in axes for p in a.trends if p.trend is not None]
    labels, trends = [(a.id, p.name) for a, p, _ in known], [t for *_, t in known]
    yield MetricSeries("parameter_slope", labels, [t.slope for t in trends])
    yield MetricSeries("parameter_slope_standard_deviation", labels, [t.slope_sd for t in trends])
    probability = [t.probability["drift"] + t.probability["both"] for t in trends]
    yield MetricSeries("parameter_drift_probability", labels, probability)
    reaches = [((a.id, r.name, "upper" if r.above else "lower"), a, p, t, r) for a, p, t in known for r in p.reaches]
    ends = [
        ((*limit, bound), (t_us - t.time_us) / 1e6)
        for limit, _, _, t, r in reaches
        for bound, t_us in (("low", r.low_us), ("high", r.high_us))
        if t_us is not None
    ]
    yield MetricSeries("limit_reached_seconds", [end for end, _ in ends], [s for _, s in ends])
    limits = [limit for limit, *_ in reaches]
    yield MetricSeries("limit_alarm_active", limits, [_is_limit_alarm_open(a, p.name, r) for _, a, p, _, r in reaches])
    yield MetricSeries("histories_lost", _ids(axes), [a.histories_lost for a in axes])


def _is_limit_alarm_open(axis: AxisSnapshot, parameter: str, reach: Reach) -> bool:
    return any(
        (limit.name, limit.above) == (reach.name, reach.above)
        for e in axis.open_alarms
        if e.kind == "forecast" and e.parameter == parameter
        for limit in e.reaches
    )


def _buses(snapshot: Snapshot) -> Iterator[MetricSeries]:
    buses, names = snapshot.buses, [(b.name,) for b in snapshot.buses]
    yield MetricSeries("bus_up", names, [b.up for b in buses])
    yield MetricSeries("frames", names, [b.frames for b in buses])
    yield _by_reason("frames_dropped", [b.name for b in buses], [b.dropped for b in buses])


def _of_links(links: Sequence[LinkSnapshot]) -> Iterator[MetricSeries]:
    names = [(link.name,) for link in links]
    yield MetricSeries("link_connected", names, [link.connected for link in links])
    yield MetricSeries("link_pending", names, [link.pending for link in links])
    yield MetricSeries("link_delivered", names, [link.delivered for link in links])
    yield _by_reason("link_given_up", [link.name for link in links], [link.given_up for link in links])
