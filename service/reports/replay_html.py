"""What a replay found, as one page that needs nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from monitor_core.monitoring import ParameterTrend
from monitor_core.trend import COVERED
from service.reports.page import document, legend, listed, section, sentences, tiles, verdict
from service.reports.replay_course import SIGMAS
from service.reports.replay_plots import axis_pictures
from service.reports.replay_result import Replayed, ReplayedAxis, dated, duration
from service.reports.replay_tables import alarm_table, counter_table, frame_table, parameter_table
from service.reports.text_format import escaped
from service.reports.trend_plots import trend_picture
from service.texts.trend_texts import reach_words, trend_words

_LEGEND = (
    f"Estimate with a band of ± {SIGMAS:g} reported standard deviations, √(λ₀ P<sub>ii</sub> / (1 + λ)), with"
    " random_walk √(λ₀ P<sub>ii</sub> / 2). Between the dotted lines, nominal ± ν with ν = α₁ √(λ₀ P<sub>ii</sub>) and"
    " an allowance, if there is one, g falls; outside it"
    " grows, and the alarm is raised where it crosses h, then g starts again from zero. Of a long"
    " record each point stands for a short stretch: of estimates the mean, shaded from the least to the largest, of g"
    " both, so that no crossing is lost. Grey: nothing was learned, estimates and tests wait."
)

_BANK_LEGEND = (
    " Of the multi-model detector each line is the largest g / h among the sizes of a cause. The alarm is raised where"
    " one crosses h; then they grow on until the cause is named, and start again around what has changed: beyond h"
    " their scale is logarithmic."
)
_TREND_LEGEND = (
    "Each entry is the mean over some time in operation, with the standard deviation that P gives it; by how much more"
    " than that they scatter is found from the entries. The course is what all that may have been (steady, a drift, a"
    f" step, or both) say together, each by its probability; the band holds it with {100 * COVERED:.0f} % at each time."
    " The interval in which a limit is reached begins where one edge of the band reaches it, and ends where the other"
    " does."
)


def as_html(found: Replayed) -> str:
    """The whole page."""
    title = f"Replay of {_names(found)}"
    subtitle = f"{escaped(found.config)}<br>{escaped(found.date[:10])}, axiswatch {escaped(found.version)}"
    return document(title, subtitle, _verdict(found), _tiles(found), *_sections(found))


def _names(found: Replayed) -> str:
    first, more = found.records[0], len(found.records) - 1
    return f"{first} and {more} more" if more else first


def _verdict(found: Replayed) -> str:
    count = sum(len(axis.alarms) for axis in found.axes)
    silent = [axis.id for axis in found.axes if not axis.status.samples]
    idle = [axis.id for axis in found.axes if axis.status.samples and not axis.status.counters["used"]]
    rest = f" No samples of {', '.join(silent)}." if silent else ""
    rest += f" Nothing was learned of {', '.join(idle)}." if idle else ""
    if count:
        of = [axis.id for axis in found.axes if axis.alarms]
        return verdict("bad", f"{count} alarm{_s(count)}", f"of {', '.join(of)}.{rest}")
    if rest:
        return verdict("warn", "No alarm.", rest.strip())
    return verdict("good", "No alarm.", "")


def _tiles(found: Replayed) -> str:
    samples = sum(axis.status.samples for axis in found.axes)
    used = sum(axis.status.counters["used"] for axis in found.axes)
    longest = max((1e-6 * axis.course.timeline.end_us for axis in found.axes), default=0.0)
    dropped = sum(_without_missing(axis.dropped) for axis in found.axes)
    dropped += sum(map(_without_missing, found.frames_dropped.values()))
    alarms, axes = sum(len(axis.alarms) for axis in found.axes), len(found.axes)
    return tiles(
        (
            (str(alarms), f"alarm{_s(alarms)}, on {axes} ax{'e' if axes > 1 else 'i'}s"),
            (duration(longest), "of samples; pauses do not count"),
            (f"{100 * used / samples:.1f} %", f"of {samples} samples were learned from"),
            (str(dropped), "frames, values or rows came and gave no sample"),
        )
    )


def _without_missing(dropped: Mapping[str, int]) -> int:
    """What came and gave no sample: in a pause millions may never have come."""
    return sum(count for reason, count in dropped.items() if reason != "missing")


def _s(count: int) -> str:
    return "" if count == 1 else "s"


def _sections(found: Replayed) -> Iterator[str]:
    notes = [words for axis in found.axes for words in axis.notes]
    if notes:
        yield section("What to look at", sentences(notes))
    alarms = alarm_table(found)
    if alarms:
        yield section("Alarms", alarms)
    for number, axis in enumerate(found.axes):
        yield section(escaped(axis.id), *_axis(axis, f"axis{number}"))
    if found.frames_dropped:
        yield section("Frames that gave nothing", frame_table(found.frames_dropped))
    yield section("Where it comes from", _origin(found))


def _axis(axis: ReplayedAxis, salt: str) -> Iterator[str]:
    if axis.status.samples:
        yield f"<p>{escaped(_span(axis))}{escaped(_detectors(axis))}</p>"
        yield parameter_table(axis)
    if axis.course.used:
        yield from (f"<figure>{picture}</figure>" for picture in axis_pictures(axis, salt))
        yield legend(_LEGEND + (_BANK_LEGEND if axis.course.beside is not None else ""))
    else:
        yield "<p>No sample of this axis.</p>"
    if axis.trends:
        yield from _slow_course(axis, f"{salt}-trend")
    yield f"<h3>What became of the samples</h3>{counter_table(axis)}"


def _slow_course(axis: ReplayedAxis, salt: str) -> Iterator[str]:
    meanings = {p.name: p.meaning for p in axis.status.parameters}
    yield "<h3>Slow course, and when limits are reached</h3>"
    yield sentences(_slowly(of) for of in axis.trends)
    picture = trend_picture(axis.id, axis.trends, [meanings[of.name] for of in axis.trends], salt)
    yield f"<figure>{picture}</figure>"
    yield legend(_TREND_LEGEND)


def _slowly(of: ParameterTrend) -> str:
    """What its slow course says, and its limits."""
    now_us = of.entries[-1].end_us if of.entries else 0
    return "; ".join([trend_words(of.name, of.unit, of.trend), *(reach_words(r, now_us) for r in of.reaches)])


def _detectors(axis: ReplayedAxis) -> str:
    """The detector that alarms, and the leading cause of the detector in shadow mode."""
    said = ""
    for one in axis.status.detectors:
        name = "multi-model detector" if one.name == "multimodel" else "CUSUM tests"
        if one.alarms:
            said += f" Alarms come from the {name}."
        elif one.leading:
            said += (
                f" The {name} ran in shadow mode; its strongest evidence at the end is that of {one.leading}."
            )
    return said


def _span(axis: ReplayedAxis) -> str:
    line = axis.course.timeline
    words = f"Drive {axis.drive}. {duration(1e-6 * line.end_us)} of samples"
    start, end = (dated(t) for t in (line.start_us, axis.status.time_us))
    words += f", from {start} to {end} UTC" if start and end else ""
    return f"{words}, with {line.pauses} pause{_s(line.pauses)} cut out." if line.pauses else f"{words}."


def _origin(found: Replayed) -> str:
    program = f"<p>axiswatch {escaped(found.version)}, {escaped(found.date)}. To do it again:</p>"
    return f"{listed(map(escaped, found.records))}{program}<pre>{escaped(found.command)}</pre>"
