"""Gauges of the slow courses; absent while they are not known."""

from collections.abc import Iterator

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric

from service.monitoring.snapshot import AxisSnapshot


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
                for bound, t_us in (("low", r.low_us), ("high", r.high_us)):
                    if t_us is not None:
                        reached.add_metric((axis.id, r.name, side, bound), (t_us - p.trend.time_us) / 1e6)
    yield from (slope, deviation, probability, reached, lost)
