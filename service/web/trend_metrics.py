"""Gauges of the slow courses; absent while they are not known."""

from collections.abc import Iterator

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric

from monitor_core.detection.alarm import Reach
from service.pipeline.snapshot import AxisSnapshot


def families(axes: tuple[AxisSnapshot, ...]) -> Iterator[Metric]:
    """Slope, its standard deviation, the probability of a drift, and when limits are reached."""
    slope = GaugeMetricFamily(
        "axiswatch_parameter_slope",
        "Slow drift, in the parameter's SI unit per second; absent until enough is known.",
        labels=("axis", "parameter"),
    )
    deviation = GaugeMetricFamily(
        "axiswatch_parameter_slope_standard_deviation",
        "Standard deviation of the slow drift, in the parameter's SI unit per second; absent until enough is known.",
        labels=("axis", "parameter"),
    )
    probability = GaugeMetricFamily(
        "axiswatch_parameter_drift_probability",
        "Probability that the parameter drifts slowly; absent until enough is known.",
        labels=("axis", "parameter"),
    )
    reached = GaugeMetricFamily(
        "axiswatch_limit_reached_seconds",
        "Time from the last entry of the slow history until a limit is reached, in seconds: lower (low) and upper"
        " (high) end of the interval of 90 %; negative where it has been reached; no upper end where it is open.",
        labels=("axis", "parameter", "limit", "bound"),
    )
    warned = GaugeMetricFamily(
        "axiswatch_limit_alarm_active",
        "1 while an alarm is open as a limit is about to be reached, or has been, else 0.",
        labels=("axis", "parameter", "limit"),
    )
    lost = CounterMetricFamily(
        "axiswatch_histories_lost",
        "Slow histories that could not be put back at the start, as they were damaged or of another model.",
        labels=("axis",),
    )
    for axis in axes:
        lost.add_metric((axis.id,), axis.histories_lost)
        for p in axis.trends:
            if p.trend is None:
                continue
            labels = axis.id, p.name
            slope.add_metric(labels, p.trend.slope)
            deviation.add_metric(labels, p.trend.slope_sd)
            probability.add_metric(labels, p.trend.probability["drift"] + p.trend.probability["both"])
            for r in p.reaches:
                side = "upper" if r.above else "lower"
                warned.add_metric((axis.id, r.name, side), float(_is_open(axis, p.name, r)))
                for bound, t_us in (("low", r.low_us), ("high", r.high_us)):
                    if t_us is not None:
                        reached.add_metric((axis.id, r.name, side, bound), (t_us - p.trend.time_us) / 1e6)
    yield from (slope, deviation, probability, reached, warned, lost)


def _is_open(axis: AxisSnapshot, parameter: str, r: Reach) -> bool:
    """Whether an alarm about this limit is open."""
    told = [
        of
        for e in axis.open_episodes
        if e.kind == "forecast" and e.parameter == parameter
        for of in e.reaches
    ]
    return any((of.name, of.above) == (r.name, r.above) for of in told)
