"""Prometheus metrics, built from the newest snapshot at each scrape (prometheus_client's custom collector)."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import accumulate

from prometheus_client import CollectorRegistry
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    InfoMetricFamily,
    Metric,
)
from prometheus_client.exposition import choose_encoder
from prometheus_client.process_collector import ProcessCollector
from prometheus_client.registry import Collector

from monitor_core.detection import DIRECTIONS, Direction, Reach, Stage
from monitor_core.monitoring import DetectorStatus, Observation, ParameterStatus
from monitor_core.trend import Trend
from service.pipeline.snapshot import AxisSnapshot, Snapshot
from service.web.app_state import VERSION, age_s, sample_age_s

_Series = tuple[tuple[str, ...], float]
_UNIT = "in the parameter's SI unit"


def registry(snapshot: Callable[[], Snapshot], now_us: Callable[[], int]) -> CollectorRegistry:
    """The metrics of the daemon and of its process."""
    collectors = CollectorRegistry()
    collectors.register(SnapshotCollector(snapshot, now_us))
    ProcessCollector(registry=collectors)
    return collectors


def render(collectors: CollectorRegistry, accept: str) -> tuple[bytes, str]:
    """Body and content type of a scrape, in a format that the Accept header allows."""
    encoder, content_type = choose_encoder(accept)
    return encoder(collectors), content_type


class SnapshotCollector(Collector):
    """All metrics of a snapshot."""

    def __init__(self, snapshot: Callable[[], Snapshot], now_us: Callable[[], int]) -> None:
        self._snapshot, self._now_us = snapshot, now_us

    def collect(self) -> Iterator[Metric]:
        """All metric families, from one snapshot."""
        snapshot, now_us = self._snapshot(), self._now_us()
        yield InfoMetricFamily("axiswatch_build", "Version of axiswatch.", value={"version": VERSION})
        yield from _parameters(snapshot.axes)
        yield from _detectors(snapshot.axes)
        yield from _axes(snapshot.axes, now_us)
        yield from _trends(snapshot.axes)
        yield from _buses(snapshot)
        yield from _service(snapshot, now_us)


def _parameters(axes: tuple[AxisSnapshot, ...]) -> Iterator[Metric]:
    """Gauges of every monitored parameter; most are in its unit, which /api/v1/axes states."""

    def gauge(name: str, words: str, value: Callable[[ParameterStatus], float]) -> Metric:
        series = (((axis.id, p.name), value(p)) for axis in axes for p in axis.status.parameters)
        return _gauge(name, words, ("axis", "parameter"), series)

    def both(
        name: str, words: str, value: Callable[[AxisSnapshot, ParameterStatus, Direction], float]
    ) -> Metric:
        series = (
            ((axis.id, p.name, d), value(axis, p, d))
            for axis in axes
            for p in axis.status.parameters
            for d in DIRECTIONS
        )
        return _gauge(name, words, ("axis", "parameter", "direction"), series)

    def alarm(name: str, words: str, *stages: Stage) -> Metric:
        series = (
            ((axis.id, cause, d), float(_is_open(axis, cause, d, *stages)))
            for axis in axes
            for cause in axis.causes
            for d in DIRECTIONS
        )
        return _gauge(name, words, ("axis", "parameter", "direction"), series)

    p_ii = "P_ii of the recursion; the variance of the estimate is lambda_0 P_ii / (1 + lambda)."
    yield gauge("parameter_estimate", f"Estimated value, {_UNIT}.", lambda p: p.estimate)
    yield gauge(
        "parameter_nominal",
        f"Commissioned value, which may follow operating conditions, {_UNIT}.",
        lambda p: p.nominal,
    )
    yield gauge(
        "parameter_standard_deviation", f"Standard deviation, {_UNIT}.", lambda p: p.standard_deviation
    )
    yield gauge("parameter_p_diagonal", p_ii, lambda p: p.p_diagonal)
    yield gauge(
        "parameter_observed",
        "Observability of the parameter in the last samples: 1 as at commissioning, 0.5 weak, 0 not observed; then "
        "the estimate is the last that was observed.",
        lambda p: _OBSERVED[p.observation],
    )
    yield both(
        "cusum",
        f"CUSUM g for an increase (up) and a decrease (down), {_UNIT} times samples.",
        lambda _, p, d: p.g_up if d == "up" else p.g_down,
    )
    yield gauge("cusum_threshold", f"Threshold h of both CUSUMs, {_UNIT} times samples.", lambda p: p.h)
    yield alarm("alarm_active", "1 while an alarm is open, else 0.")
    yield alarm("alarm_named", "1 while an alarm is open and has been named, else 0.", "named")
    causes = {axis.id: _causes(axis) for axis in axes}
    yield _gauge(
        "alarm_probability",
        "Probability that the parameter is the cause of a named open alarm, else 0.",
        ("axis", "parameter"),
        (((axis.id, cause), causes[axis.id].get(cause, 0.0)) for axis in axes for cause in axis.causes),
    )


_OBSERVED = {Observation.OBSERVED: 1.0, Observation.WEAK: 0.5, Observation.UNSEEN: 0.0}


def _is_open(axis: AxisSnapshot, parameter: str, direction: str, *stages: Stage) -> bool:
    return any(
        (e.parameter, e.direction) == (parameter, direction)
        and e.stage in (stages or (e.stage,))
        and e.kind != "forecast"  # those have their own metric
        for e in axis.open_alarms
    )


def _causes(axis: AxisSnapshot) -> dict[str, float]:
    """Probability of each cause; the largest one where several alarms name it."""
    found: dict[str, float] = {}
    for e in axis.open_alarms:
        for name, probability, _ in e.causes:
            found[name] = max(found.get(name, 0.0), probability)
    return found


def _detectors(axes: tuple[AxisSnapshot, ...]) -> Iterator[Metric]:
    """Evidence of each detector, whether or not it raises the alarms."""

    def gauge(name: str, words: str, value: Callable[[DetectorStatus], float]) -> Metric:
        series = (((a.id, d.name), value(d)) for a in axes for d in a.status.detectors)
        return _gauge(name, words, ("axis", "detector"), series)

    yield gauge(
        "detector_alarms",
        "1 for the detector that raises the alarms, 0 for one that runs in shadow mode.",
        lambda d: float(d.alarms),
    )
    yield gauge(
        "detector_evidence", "Largest test statistic of a detector, over its threshold.", lambda d: d.evidence
    )


def _axes(axes: tuple[AxisSnapshot, ...], now_us: int) -> Iterator[Metric]:
    yield _gauge(
        "innovation_variance",
        "Running variance of the prediction error, in the square of the output's unit (rad or rad/s).",
        ("axis",),
        (((a.id,), a.status.innovation_variance) for a in axes),
    )
    yield _gauge(
        "axis_gated",
        "1 while operating conditions exclude the samples from estimation, else 0.",
        ("axis",),
        (((a.id,), float(bool(a.gated_by))) for a in axes),
    )
    yield _counter("samples", "Samples received.", ("axis",), (((a.id,), a.status.samples) for a in axes))
    yield _counter(
        "samples_by_fate",
        "Samples by their use; starved: too little excitation; gated: excluded by operating "
        "conditions; projected: used, and an estimate was held within its bounds.",
        ("axis", "fate"),
        _by_reason((a.id, a.status.counters) for a in axes),
    )
    yield _counter(
        "values_dropped",
        "Decoded values that did not become a sample.",
        ("axis", "reason"),
        _by_reason((a.id, a.dropped) for a in axes),
    )
    yield _counter(
        "clock_restarts",
        "Restarts of the time base of the samples: the controller restarted, or a clock was set.",
        ("axis", "cause"),
        _by_reason((a.id, a.clock) for a in axes),
    )
    yield _gauge(
        "stamp_scatter_seconds",
        "Standard deviation of receipt time minus sample time, in seconds; where the receipt time is the sample "
        "time, that of the intervals divided by the square root of two.",
        ("axis",),
        (((a.id,), a.stamps.scatter_s) for a in axes if a.stamps.scatter_s is not None),
    )
    # +Inf before the first sample: the rule for a silent axis then also covers one that was never received.
    ages = [(a.id, sample_age_s(a, now_us)) for a in axes]
    yield _gauge(
        "last_sample_age_seconds",
        "Time since the last sample, in seconds; +Inf before the first.",
        ("axis",),
        (((axis,), math.inf if age is None else age) for axis, age in ages),
    )


def _trends(axes: tuple[AxisSnapshot, ...]) -> Iterator[Metric]:
    """Slope, its standard deviation, the probability of a drift, and the times at which limits are reached."""

    def gauge(name: str, words: str, value: Callable[[Trend], float]) -> Metric:
        series = (((a.id, p.name), value(p.trend)) for a in axes for p in a.trends if p.trend is not None)
        return _gauge(name, words, ("axis", "parameter"), series)

    per_second = "in the parameter's SI unit per second; absent until enough is known"
    yield gauge("parameter_slope", f"Long-term drift, {per_second}.", lambda t: t.slope)
    yield gauge(
        "parameter_slope_standard_deviation",
        f"Standard deviation of the long-term drift, {per_second}.",
        lambda t: t.slope_sd,
    )
    yield gauge(
        "parameter_drift_probability",
        "Probability of a long-term drift of the parameter; absent until enough is known.",
        lambda t: t.probability["drift"] + t.probability["both"],
    )
    reaches = [(a, p, p.trend, r) for a in axes for p in a.trends if p.trend is not None for r in p.reaches]
    yield _gauge(
        "limit_reached_seconds",
        "Time from the last entry of the long-term history until a limit is reached, in seconds: lower (low) and "
        "upper (high) end of the 90 % interval; negative where it has been reached; no upper end where it is open.",
        ("axis", "parameter", "limit", "bound"),
        (
            ((a.id, r.name, _side(r), bound), (t_us - t.time_us) / 1e6)
            for a, _, t, r in reaches
            for bound, t_us in (("low", r.low_us), ("high", r.high_us))
            if t_us is not None
        ),
    )
    yield _gauge(
        "limit_alarm_active",
        "1 while an alarm is active because a limit will be reached soon, or has been, else 0.",
        ("axis", "parameter", "limit"),
        (((a.id, r.name, _side(r)), float(_is_limit_alarm_open(a, p.name, r))) for a, p, _, r in reaches),
    )
    yield _counter(
        "histories_lost",
        "Long-term histories that could not be restored at the start: damaged, or of another model.",
        ("axis",),
        (((a.id,), a.histories_lost) for a in axes),
    )


def _side(reach: Reach) -> str:
    return "upper" if reach.above else "lower"


def _is_limit_alarm_open(axis: AxisSnapshot, parameter: str, reach: Reach) -> bool:
    return any(
        (limit.name, limit.above) == (reach.name, reach.above)
        for e in axis.open_alarms
        if e.kind == "forecast" and e.parameter == parameter
        for limit in e.reaches
    )


def _buses(snapshot: Snapshot) -> Iterator[Metric]:
    buses = snapshot.buses
    up = (((b.name,), float(b.up)) for b in buses)
    yield _gauge("bus_up", "1 while the bus can be read, else 0.", ("bus",), up)
    yield _counter("frames", "Frames received.", ("bus",), (((b.name,), b.frames) for b in buses))
    yield _counter(
        "frames_dropped",
        "Frames that were dropped.",
        ("bus", "reason"),
        _by_reason((b.name, b.dropped) for b in buses),
    )


def _service(snapshot: Snapshot, now_us: int) -> Iterator[Metric]:
    yield _gauge(
        "snapshot_age_seconds",
        "Time since the worker last reported, in seconds.",
        (),
        [((), age_s(snapshot.taken_us, now_us))],
    )
    saved = snapshot.checkpoint_us
    yield _gauge(
        "checkpoint_age_seconds",
        "Time since the state of the monitors was last saved, in seconds; absent before the first time.",
        (),
        [] if saved is None else [((), age_s(saved, now_us))],
    )
    histogram = snapshot.processing
    bounds = [*(str(bound) for bound in histogram.bounds), "+Inf"]
    yield HistogramMetricFamily(
        "axiswatch_processing_seconds",
        "Time to process a block of samples, in seconds.",
        buckets=list(zip(bounds, accumulate(map(float, histogram.counts)), strict=True)),
        sum_value=histogram.total_s,
    )


def _by_reason(counts: Iterable[tuple[str, Mapping[str, int]]]) -> Iterator[_Series]:
    return (((name, reason), number) for name, numbers in counts for reason, number in numbers.items())


def _gauge(name: str, words: str, labels: tuple[str, ...], series: Iterable[_Series]) -> Metric:
    family = GaugeMetricFamily(f"axiswatch_{name}", words, labels=labels)
    for values, number in series:
        family.add_metric(values, number)
    return family


def _counter(name: str, words: str, labels: tuple[str, ...], series: Iterable[_Series]) -> Metric:
    family = CounterMetricFamily(f"axiswatch_{name}", words, labels=labels)
    for values, number in series:
        family.add_metric(values, number)
    return family
