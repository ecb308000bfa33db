"""Converts snapshots and alarms to the bodies of answers."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from pydantic_core import to_json

from monitor_core.detection import Reach
from monitor_core.drive import OUTPUT_UNITS
from monitor_core.monitoring import ParameterStatus, ParameterTrend
from monitor_core.trend import Trend, thinned
from monitor_core.wording import sentence
from service.config.public_text import public_words
from service.pipeline.persistence.replay_reports import ReportState
from service.pipeline.snapshot import AxisSnapshot, LinkSnapshot, Snapshot
from service.store.alarm_table import RecordedAlarm
from service.store.alarm_transitions import Note, RecordedTransition
from service.texts.alarm_words import episode_words
from service.texts.instants import iso
from service.texts.not_tested_words import not_tested_sentences
from service.texts.trend_words import reach_words, trend_words
from service.web import models
from service.web.app_state import VERSION, is_silent, reasons_not_ready, sample_age_s

_B = TypeVar("_B", bound=models.Body)
_A = TypeVar("_A", bound=models.Alarm)


def body(kind: type[_B], *sources: object, **own: object) -> _B:
    """Make a body from fields given by keyword and attributes of the sources.

    An attribute has the name of the field, or, for a time such as ``onset``, the name ``onset_us``.
    """
    shape = (kind, tuple(map(type, sources)), tuple(own))
    if shape not in _PLACES:
        _PLACES[shape] = tuple(_place(sources, name) for name in kind.model_fields.keys() - own.keys())
    for name, source, attribute in _PLACES[shape]:
        own[name] = getattr(sources[source], attribute)
    return kind.model_validate(own)


_PLACES: dict[object, tuple[tuple[str, int, str], ...]] = {}
"""Cache of the source and attribute of each field of a body, as searching for them takes most of the time."""


def _place(sources: Sequence[object], name: str) -> tuple[str, int, str]:
    places = ((i, known) for i in range(len(sources)) for known in (f"{name}_us", name))
    return name, *next((i, known) for i, known in places if hasattr(sources[i], known))


def axes_json(snapshot: Snapshot, axes: Iterable[bytes]) -> bytes:
    """The body of models.Axes from the JSON of its axes."""
    return b'{"taken":"%b","axes":[%b]}' % (iso(snapshot.taken_us).encode(), b",".join(axes))


def axis(a: AxisSnapshot, now_us: int) -> models.Axis:
    """One axis."""
    return models.Axis.model_validate(_axis(a, now_us))


def axis_json(a: AxisSnapshot, now_us: int) -> bytes:
    """The JSON of models.Axis, made in a fifth of the model's time, as pages request all axes each second."""
    return to_json(_axis(a, now_us), inf_nan_mode="null")


def _axis(a: AxisSnapshot, now_us: int) -> dict[str, object]:
    """The fields of models.Axis in their order, as in JSON."""
    status, out, heat = a.status, out_of_service(a.out_of_service), a.heat
    return {
        "id": a.id,
        "robot": a.robot,
        "name": a.name,
        "bus": a.bus,
        "last_sample": None if status.time_us is None else iso(status.time_us),
        "last_sample_age_s": sample_age_s(a, now_us),
        "silent": is_silent(a, now_us),
        "parameters": [_parameter(p) for p in status.parameters],
        "innovation_variance": status.innovation_variance,
        "innovation_unit": OUTPUT_UNITS[a.output],
        "samples": status.samples,
        "confounded": status.confounded,
        "gated_by": a.gated_by or None,
        "counters": status.counters,
        "dropped": a.dropped,
        "clock": a.clock,
        "stamps": {name: getattr(a.stamps, name) for name in ("clock", "scatter_s", "interval_s")},
        "detectors": [
            {"name": d.name, "alarms": d.alarms, "leading": d.leading or None, "evidence": d.evidence}
            for d in status.detectors
        ],
        "outside_calibration": a.outside_calibration,
        "heat": None if heat is None else heat._asdict(),
        "not_tested": [*not_tested_sentences(status.untested(), status, a.gated_by)],
        "open_alarms": list(dict.fromkeys(e.parameter for e in a.open_alarms if e.kind != "forecast")),
        "epoch": {**a.epoch._asdict(), "words": a.epoch.words},
        "out_of_service": None if out is None else out.model_dump(),
        "model": {
            "drive": a.drive,
            "output": a.output,
            "nominal": [{"name": n, "value": value, "unit": unit} for n, (value, unit) in a.nominal.items()],
        },
        "sentences": models.sentences((*status.confounded, *a.outside_calibration, a.gated_by)),
    }


def _parameter(p: ParameterStatus) -> dict[str, object]:
    """The fields of models.Parameter."""
    return {
        "name": p.name,
        "unit": p.unit,
        "meaning": p.meaning,
        "nominal": p.nominal,
        "estimate": p.estimate,
        "standard_deviation": p.standard_deviation,
        "p_diagonal": p.p_diagonal,
        "cusum": {"up": p.g_up, "down": p.g_down},
        "threshold": p.h,
        "tolerance": p.nu,
        "status": p.status,
        "observation": p.observation,
        "tested": p.tested,
        "not_tested_reason": p.not_tested,
        "tested_s": p.tested_s,
    }


def out_of_service(note: Note | None) -> models.OutOfService | None:
    """Author, time and reason of taking an axis out of service."""
    return None if note is None else body(models.OutOfService, note, since=note.at_us or None)


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
    return body(
        models.LongTermHistory,
        p,
        words=trend_words(p.name, p.unit, p.trend),
        drift=None if p.trend is None else _drift(p.trend),
        limits=[reach(r, now_us) for r in p.reaches],
        time=[e.middle_us for e in entries],
        mean=[e.mean for e in entries],
        standard_deviation=[math.sqrt(e.variance) for e in entries],
        operating_s=[e.operating_s for e in entries],
    )


def _drift(t: Trend) -> models.Drift:
    per_day = {"slope_per_day": t.slope * 86400, "slope_per_day_sd": t.slope_sd * 86400}
    since = {"changed": t.change_us, "change": t.change}
    return body(models.Drift, t, **t.probability, **per_day, **since)


def reach(r: Reach, now_us: int) -> models.Reach:
    """The time at which a limit is reached; its words are relative to ``now_us``."""
    return body(models.Reach, r, words=reach_words(r, now_us))


def alarm(a: RecordedAlarm, now_us: int = 0, recording: str | None = None) -> models.Alarm:
    """An alarm in its state at this time, with the name of its recording."""
    return _alarm(models.Alarm, a, now_us, recording=recording)


def alarm_record(
    a: RecordedAlarm,
    transitions: Iterable[RecordedTransition],
    now_us: int,
    recording: str | None,
    report: ReportState | None,
) -> models.AlarmRecord:
    """An alarm with its transitions, the name of its recording, and the state of its report."""
    found = [body(models.AlarmTransition, t) for t in transitions]
    shown = report and models.ReplayReport(**report._asdict(), sentences=models.sentence_bodies((report.problem,)))
    return _alarm(models.AlarmRecord, a, now_us, transitions=found, recording=recording, report=shown)


def _alarm(kind: type[_A], a: RecordedAlarm, now_us: int, **own: object) -> _A:
    life = a.life.at(now_us)
    return body(
        kind,
        a,
        id=a.id or None,
        state=life.state,
        returns_to=life.returns_to,
        shelved_until=life.until_us,
        reaches=[reach(r, a.updated_us) for r in a.reaches],
        words=episode_words(a, a.nominal, a.unit, a.same_payload),
        past=[body(models.PastName, name) for name in a.past],
        **own,
    )


def alarm_message(
    message_id: str, transition: RecordedTransition, a: RecordedAlarm, recording: str | None, now_us: int
) -> models.AlarmMessage:
    """A transition of an alarm for plant links, with the alarm and the name of its recording."""
    return body(models.AlarmMessage, transition, id=message_id, alarm=alarm(a, now_us, recording))


def service(
    snapshot: Snapshot,
    now_us: int,
    report: str | None,
    insecure: str | None,
    folder: Path,
    links: Sequence[LinkSnapshot] = (),
) -> models.Service:
    """The daemon itself.

    ``report``: address of the commissioning report; ``insecure``: why it is not protected; ``folder``: that of the
    configuration: messages name files relative to it.
    """
    links = [replace(link, problem=public_words(link.problem, folder)) for link in links]
    reasons = list(reasons_not_ready(snapshot, now_us))
    down = (sentence("link", "link {name}: {why}", name=n.name, why=n.problem) for n in links if n.problem)
    messages = [*(public_words(words, folder) for words in snapshot.messages), *down]
    own = {
        "links": links,
        "messages": messages,
        "sentences": models.sentences(
            (*messages, *(bus.state for bus in snapshot.buses), *(n.problem for n in links), insecure)
        ),
        "version": VERSION,
        "ready": not reasons,
        "reasons": [reason.words for reason in reasons],
        "not_ready": [reason._asdict() for reason in reasons],
        "report": report,
        "insecure": insecure,
    }
    return body(models.Service, snapshot, **own)
