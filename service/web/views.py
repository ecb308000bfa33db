"""Snapshots and alarms converted to the bodies of answers."""

import math
from collections.abc import Sequence

from monitor_core.detection import Name, Reach
from monitor_core.monitoring import DetectorStatus, ParameterStatus, ParameterTrend
from monitor_core.trend import Trend, thinned
from service.pipeline.snapshot import AxisSnapshot, BusSnapshot, HistoryPoint, Snapshot
from service.store import journal
from service.texts.alarm_texts import episode_words
from service.texts.timestamps import iso, maybe_iso
from service.texts.trend_texts import reach_words, trend_words
from service.web import models
from service.web.app_state import VERSION, sample_age_s
from service.web.health import reasons_not_ready

OUTPUT_UNITS = {"speed": "rad/s", "mean speed": "rad/s", "angle": "rad"}


def axes(snapshot: Snapshot, now_us: int) -> models.Axes:
    """All axes of a snapshot."""
    return models.Axes(taken=iso(snapshot.taken_us), axes=[axis(a, now_us) for a in snapshot.axes])


def axis(a: AxisSnapshot, now_us: int) -> models.Axis:
    """One axis."""
    return models.Axis(
        id=a.id,
        robot=a.robot,
        name=a.name,
        bus=a.bus,
        last_sample=maybe_iso(a.status.time_us),
        last_sample_age_s=sample_age_s(a, now_us),
        parameters=[_parameter(p) for p in a.status.parameters],
        innovation_variance=a.status.innovation_variance,
        innovation_unit=OUTPUT_UNITS[a.output],
        samples=a.status.samples,
        confounded=list(a.status.confounded),
        gated_by=a.gated_by or None,
        counters=dict(a.status.counters),
        dropped=dict(a.dropped),
        clock=dict(a.clock),
        stamps=models.Stamps(**a.stamps._asdict()),
        detectors=[_detector(d) for d in a.status.detectors],
        open_alarms=list(dict.fromkeys(e.parameter for e in a.open_alarms if e.kind != "forecast")),
        model=_model(a),
    )


def _detector(d: DetectorStatus) -> models.Detector:
    return models.Detector(name=d.name, alarms=d.alarms, leading=d.leading or None, evidence=d.evidence)


def _parameter(p: ParameterStatus) -> models.Parameter:
    return models.Parameter(
        name=p.name,
        unit=p.unit,
        meaning=p.meaning,
        nominal=p.nominal,
        estimate=p.estimate,
        standard_deviation=p.standard_deviation,
        p_diagonal=p.p_diagonal,
        cusum=models.Cusum(up=p.g_up, down=p.g_down),
        threshold=p.h,
        tolerance=p.nu,
        status=p.status,
        observation=p.observation,
    )


def _model(a: AxisSnapshot) -> models.Model:
    constants = [
        models.Constant(name=name, value=value, unit=unit) for name, (value, unit) in a.nominal.items()
    ]
    return models.Model(drive=a.drive, output=a.output, nominal=constants)


def history(
    a: AxisSnapshot, parameter: str | None = None, since_us: int | None = None, limit: int = 3600
) -> models.History:
    """The last ``limit`` points of an axis after ``since_us``, of one parameter or of all."""
    points = [point for point in a.history.points if since_us is None or point.time_us > since_us][-limit:]
    return models.History(
        axis=a.id,
        time=[iso(point.time_us) for point in points],
        parameters=[
            _history(p, i, points)
            for i, p in enumerate(a.status.parameters)
            if parameter is None or p.name == parameter
        ],
    )


def _history(p: ParameterStatus, i: int, points: Sequence[HistoryPoint]) -> models.ParameterHistory:
    return models.ParameterHistory(
        name=p.name,
        unit=p.unit,
        nominal=p.nominal,
        nominals=[point.nominals[i] for point in points],
        estimate=[point.estimates[i] for point in points],
        standard_deviation=[point.standard_deviations[i] for point in points],
        cusum_up=[point.g_up[i] for point in points],
        cusum_down=[point.g_down[i] for point in points],
    )


def trend(a: AxisSnapshot, parameter: str | None = None, points: int = 1200) -> models.Trend:
    """Long-term trends of an axis, each with at most ``points`` entries."""
    return models.Trend(
        axis=a.id,
        interval_s=a.trends[0].hour_s if a.trends else None,
        lost=a.histories_lost,
        parameters=[_long_term(p, points) for p in a.trends if parameter is None or p.name == parameter],
    )


def _long_term(p: ParameterTrend, points: int) -> models.LongTermHistory:
    entries, now_us = thinned(p.entries, points), p.entries[-1].end_us if p.entries else 0
    return models.LongTermHistory(
        name=p.name,
        unit=p.unit,
        nominal=p.nominal,
        words=trend_words(p.name, p.unit, p.trend),
        drift=None if p.trend is None else _drift(p.trend),
        limits=[_reach(r, now_us) for r in p.reaches],
        time=[iso(e.middle_us) for e in entries],
        mean=[e.mean for e in entries],
        standard_deviation=[math.sqrt(e.variance) for e in entries],
        operating_s=[e.operating_s for e in entries],
    )


def _drift(t: Trend) -> models.Drift:
    return models.Drift(
        time=iso(t.time_us),
        since=iso(t.since_us),
        **t.probability,
        level=t.level,
        level_sd=t.level_sd,
        slope_per_day=t.slope * 86400,
        slope_per_day_sd=t.slope_sd * 86400,
        scatter=t.scatter,
    )


def _reach(r: Reach, now_us: int) -> models.Reach:
    times = {"low": iso(r.low_us), "high": maybe_iso(r.high_us)}
    named = {"name": r.name, "limit": r.limit, "unit": r.unit, "above": r.above, "state": r.state}
    return models.Reach.model_validate({**named, **times, "words": reach_words(r, now_us)})


def alarm(a: journal.RecordedAlarm) -> models.Alarm:
    """One alarm of the journal."""
    return models.Alarm(
        id=a.id,
        axis=a.axis,
        parameter=a.parameter,
        direction=a.direction,
        stage=a.stage,
        causes=[
            models.Cause(parameter=c.parameter, probability=c.probability, alike=list(c.alike))
            for c in a.causes
        ],
        doubt=a.doubt,
        kind=a.kind,
        reaches=[_reach(r, a.updated_us) for r in a.reaches],
        words=episode_words(a, a.nominal, a.unit),
        active=a.active,
        unit=a.unit,
        nominal=a.nominal,
        size=a.size,
        size_sd=a.size_sd,
        onset=iso(a.onset_us),
        onset_low=maybe_iso(a.onset_low_us),
        onset_high=maybe_iso(a.onset_high_us),
        raised=iso(a.raised_us),
        updated=iso(a.updated_us),
        ended=maybe_iso(a.ended_us),
        crossings=a.crossings,
        past=[_past(name) for name in a.past],
    )


def _past(name: Name) -> models.PastName:
    return models.PastName(
        until=iso(name.until_us), stage=name.stage, parameter=name.parameter, direction=name.direction
    )


def service(snapshot: Snapshot, now_us: int) -> models.Service:
    """The daemon itself."""
    reasons = reasons_not_ready(snapshot, now_us)
    return models.Service(
        version=VERSION,
        ready=not reasons,
        reasons=reasons,
        messages=list(snapshot.messages),
        started=iso(snapshot.started_us),
        taken=iso(snapshot.taken_us),
        checkpoint=maybe_iso(snapshot.checkpoint_us),
        buses=[_bus(bus) for bus in snapshot.buses],
    )


def _bus(bus: BusSnapshot) -> models.Bus:
    return models.Bus(name=bus.name, up=bus.up, state=bus.state, frames=bus.frames, dropped=dict(bus.dropped))
