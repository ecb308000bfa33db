"""Prometheus metrics, built from the newest snapshot at each scrape."""

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

from monitor_core.detection.alarm import DIRECTIONS, Direction, Stage
from monitor_core.monitoring.facts import DetectorFacts, Observation, ParameterFacts
from service.pipeline.snapshot import AxisSnapshot, Snapshot
from service.web import trend_metrics
from service.web.app_state import VERSION, age_s, sample_age_s

_Series = tuple[tuple[str, ...], float]
_UNIT = "in the parameter's SI unit"


def registry(snapshot: Callable[[], Snapshot], now_us: Callable[[], int]) -> CollectorRegistry:
    """The metrics of the daemon, with those of its process."""
    found = CollectorRegistry()
    found.register(SnapshotCollector(snapshot, now_us))
    ProcessCollector(registry=found)
    return found


def render(found: CollectorRegistry, accept: str) -> tuple[bytes, str]:
    """Body and content type of a scrape, in the format that its Accept header asks for."""
    encoder, content_type = choose_encoder(accept)
    return encoder(found), content_type


class SnapshotCollector(Collector):
    """All metrics of a snapshot."""

    def __init__(self, snapshot: Callable[[], Snapshot], now_us: Callable[[], int]) -> None:
        self._snapshot, self._now_us = snapshot, now_us

    def collect(self) -> Iterator[Metric]:
        """The families, one moment for all of them."""
        snapshot, now_us = self._snapshot(), self._now_us()
        yield InfoMetricFamily("axiswatch_build", "Version of axiswatch.", value={"version": VERSION})
        yield from _parameters(snapshot.axes)
        yield from _detectors(snapshot.axes)
        yield from _axes(snapshot.axes, now_us)
        yield from trend_metrics.families(snapshot.axes)
        yield from _buses(snapshot)
        yield from _service(snapshot, now_us)


def _parameters(axes: tuple[AxisSnapshot, ...]) -> Iterator[Metric]:
    """Gauges of every monitored parameter; most are in its unit, which /api/v1/axes tells."""

    def gauge(name: str, words: str, value: Callable[[ParameterFacts], float]) -> Metric:
        series = (((axis.id, p.name), value(p)) for axis in axes for p in axis.facts.parameters)
        return _gauge(name, words, ("axis", "parameter"), series)

    def both(
        name: str, words: str, value: Callable[[AxisSnapshot, ParameterFacts, Direction], float]
    ) -> Metric:
        series = (
            ((axis.id, p.name, d), value(axis, p, d))
            for axis in axes
            for p in axis.facts.parameters
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
        "What the last samples say of the parameter: 1 as much as at commissioning, 0.5 less, 0 nothing; then its "
        "estimate is the last that was observed.",
        lambda p: _OBSERVED[p.observation],
    )
    yield both(
        "cusum",
        f"CUSUM g for an increase (up) and a decrease (down), {_UNIT} times samples.",
        lambda _, p, d: p.g_up if d == "up" else p.g_down,
    )
    yield gauge("cusum_threshold", f"Threshold h of both CUSUMs, {_UNIT} times samples.", lambda p: p.h)
    yield alarm("alarm_active", "1 while an alarm is open, else 0.")
    yield alarm(
        "alarm_named", "1 while an alarm is open and the evidence for its name is in, else 0.", "named"
    )
    causes = {axis.id: _causes(axis) for axis in axes}
    yield _gauge(
        "alarm_probability",
        "Probability of each parameter to be the cause of an open alarm that has been named, else 0.",
        ("axis", "parameter"),
        (((axis.id, cause), causes[axis.id].get(cause, 0.0)) for axis in axes for cause in axis.causes),
    )


_OBSERVED = {Observation.OBSERVED: 1.0, Observation.WEAK: 0.5, Observation.UNSEEN: 0.0}


def _is_open(axis: AxisSnapshot, parameter: str, direction: str, *stages: Stage) -> bool:
    return any(
        (e.parameter, e.direction) == (parameter, direction)
        and e.stage in (stages or (e.stage,))
        and e.kind != "forecast"  # those have their own metric
        for e in axis.open_episodes
    )


def _causes(axis: AxisSnapshot) -> dict[str, float]:
    """Probabilities of the causes of its alarms, the largest where a parameter is among those of several."""
    found: dict[str, float] = {}
    for e in axis.open_episodes:
        for name, probability, _ in e.causes:
            found[name] = max(found.get(name, 0.0), probability)
    return found


def _detectors(axes: tuple[AxisSnapshot, ...]) -> Iterator[Metric]:
    """What each detector says, whether or not its alarms are those of the axis."""

    def gauge(name: str, words: str, value: Callable[[DetectorFacts], float]) -> Metric:
        series = (((a.id, d.name), value(d)) for a in axes for d in a.facts.detectors)
        return _gauge(name, words, ("axis", "detector"), series)

    yield gauge(
        "detector_alarms",
        "1 of the detector whose alarms count, 0 of one that looks on.",
        lambda d: float(d.alarms),
    )
    yield gauge(
        "detector_open_alarms",
        "Alarms that are open by what a detector says, whether they count or not.",
        lambda d: float(len(d.open)),
    )
    yield gauge(
        "detector_evidence", "Largest test statistic of a detector, over its threshold.", lambda d: d.evidence
    )


def _axes(axes: tuple[AxisSnapshot, ...], now_us: int) -> Iterator[Metric]:
    yield _gauge(
        "innovation_variance",
        "Running variance of the prediction error, in the square of the output's unit (rad or rad/s).",
        ("axis",),
        (((a.id,), a.facts.innovation_variance) for a in axes),
    )
    yield _gauge(
        "axis_gated",
        "1 while operating conditions forbid to learn from the samples, else 0.",
        ("axis",),
        (((a.id,), float(bool(a.gated_by))) for a in axes),
    )
    yield _counter("samples", "Samples received.", ("axis",), (((a.id,), a.facts.samples) for a in axes))
    yield _counter(
        "samples_by_fate",
        "What became of the samples; starved: nothing to learn; gated: operating conditions forbid it; "
        "projected: used, an estimate was held in its bounds.",
        ("axis", "fate"),
        _by_reason((a.id, a.facts.counters) for a in axes),
    )
    yield _counter(
        "values_dropped",
        "Decoded values that did not become a sample.",
        ("axis", "reason"),
        _by_reason((a.id, a.dropped) for a in axes),
    )
    yield _counter(
        "clock_restarts",
        "How often the time line of the samples began anew: the controller restarted, or a clock was set.",
        ("axis", "cause"),
        _by_reason((a.id, a.clock) for a in axes),
    )
    yield _gauge(
        "stamp_scatter_seconds",
        "Standard deviation of time of receipt minus time of the sample, in seconds; where the times of receipt are "
        "those of the samples, of the intervals, over the root of two.",
        ("axis",),
        (((a.id,), a.stamps.scatter_s) for a in axes if a.stamps.scatter_s is not None),
    )
    # +Inf before the first sample: the rule that finds a silent axis also finds one that was never heard.
    ages = [(a.id, sample_age_s(a, now_us)) for a in axes]
    yield _gauge(
        "last_sample_age_seconds",
        "Time since the last sample, in seconds; +Inf before the first.",
        ("axis",),
        (((axis,), math.inf if age is None else age) for axis, age in ages),
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
