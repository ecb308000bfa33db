"""Queries to the history: chooses a resolution, and merges its rows to at most the requested number."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple

from monitor_core.arrays import Ints
from service.store.history_rows import NO_ROWS, HistoryRows, aligned, merged
from service.store.history_store import PERIODS_S, RESOLUTIONS, HistorySeries, HistoryStore, HistoryView, Resolution

MOST_POINTS = 5000
_DAY_S = 86400
_STEPS_S = (
    *(1, 2, 5, 10, 20, 30, 60, 120, 180, 300, 600, 900, 1200, 1800),
    *(hours * 3600 for hours in (1, 2, 3, 4, 6, 8, 12)),
)
"""Lengths of a row in round units of time; longer ones are whole days"""
_GAP_STEPS = 1.5
"""If the starts of two rows are farther apart than this number of steps, there is a gap between them."""


@dataclass(frozen=True, slots=True)
class Question:
    """A query.  Times in seconds since 1970; ``until_s`` is not included.

    ``resolution``: return the first ``points`` stored rows of it; None: return at most ``points`` merged rows of the
    whole range.  ``interval_s``: interval in which points are recorded.
    """

    axis: str
    interval_s: float
    parameter: str | None = None
    since_s: int | None = None
    until_s: int | None = None
    points: int = 600
    resolution: Resolution | None = None


class ParameterRows(NamedTuple):
    """The rows of a parameter."""

    series: HistorySeries
    rows: HistoryRows


class HistoryAnswer(NamedTuple):
    """Rows of all parameters at common times ``t`` (M,) [s since 1970], each ``step_s`` long, oldest first.

    ``next_s``: start of the next query, if there are more rows; None: there are no more.
    """

    resolution: Resolution
    step_s: int
    t: Ints
    courses: tuple[ParameterRows, ...]
    next_s: int | None = None


def ask(store: HistoryStore, question: Question) -> HistoryAnswer:
    """Answer a query.

    Raises:
        StoreError: the file cannot be read.
    """
    with store.read() as view:
        known = view.series(question.axis, question.parameter)
        ends = view.ends(known)
        if not ends:
            nothing = [NO_ROWS] * len(known)
            return _aligned(question, question.resolution or "raw", _step(question), known, nothing)
        if question.resolution is not None:
            return _as_stored(view, question, known, question.resolution)
        since_s, until_s = _range(question, ends)
        table, step_s = _choice(question, since_s, until_s, ends)
        since_s = since_s // step_s * step_s
        rows = [merged(view.rows(table, number, since_s, until_s), step_s)[0] for number in known]
    return _aligned(question, table, step_s, known, rows)


def pages(store: HistoryStore, question: Question) -> Iterator[HistoryAnswer]:
    """All stored rows in parts; without a resolution, those of the finest one that goes back to ``since_s``."""
    with store.read() as view:
        ends = view.ends(view.series(question.axis, question.parameter))
    if question.resolution is None and ends:
        since_s, _ = _range(question, ends)
        question = replace(question, resolution=_reaching("raw", since_s, ends))
    question = replace(question, points=MOST_POINTS, resolution=question.resolution or "raw")
    following: int | None = 0
    while following is not None:
        yield (answer := ask(store, question))
        following = answer.next_s
        question = replace(question, since_s=following)


_Ends = Mapping[Resolution, tuple[int, int]]


def _range(question: Question, ends: _Ends) -> tuple[int, int]:
    """The requested range, limited to the time for which there are rows."""
    finest, *coarser = ends
    first = ends[finest][0]
    for table in coarser:  # a coarse row starts before the first point in it, so only complete rows count
        first = ends[table][0] if ends[table][0] + PERIODS_S[table] <= first else first
    last = min(begin + PERIODS_S[table] for table, (_, begin) in ends.items())
    since_s = first if question.since_s is None else max(question.since_s, first)
    until_s = last if question.until_s is None else min(question.until_s, last)
    return since_s, until_s


def _step(question: Question) -> int:
    """The smallest length of a row: the recording interval [s]."""
    return max(1, round(question.interval_s))


def _choice(question: Question, since_s: int, until_s: int, ends: _Ends) -> tuple[Resolution, int]:
    """The table to read, and the length of a merged row [s]."""
    least = _step(question)
    # The longest step starts at zero, so that one row is always possible; shorter ones may have a boundary in the
    # range.
    days = range(1, 2 + until_s // _DAY_S)
    steps = (s for s in chain((least, *_STEPS_S), (_DAY_S * d for d in days)) if s >= least)
    step_s = next((s for s in steps if _number(since_s, until_s, s) <= question.points), least)
    finest = next(t for t in reversed(RESOLUTIONS) if step_s % PERIODS_S[t] == 0)
    table = _reaching(finest, since_s, ends)
    return table, max(step_s, PERIODS_S[table])


def _number(since_s: int, until_s: int, step_s: int) -> int:
    return (until_s - 1) // step_s - since_s // step_s + 1


def _reaching(table: Resolution, since_s: int, ends: _Ends) -> Resolution:
    """This table, or the finest of the coarser ones that has older rows after ``since_s``."""
    for coarser in RESOLUTIONS[RESOLUTIONS.index(table) + 1 :]:
        if coarser not in ends:
            continue
        period = PERIODS_S[coarser]
        first = max(ends[coarser][0], since_s // period * period)
        begin = ends[table][0] if table in ends else first + period
        if since_s < begin and first + period <= begin:  # rows of a time of which the finer one has none
            table = coarser
    return table


def _as_stored(
    view: HistoryView, question: Question, known: Mapping[int, HistorySeries], table: Resolution
) -> HistoryAnswer:
    since_s = 0 if question.since_s is None else question.since_s // PERIODS_S[table] * PERIODS_S[table]
    until_s = 1 << 62 if question.until_s is None else question.until_s
    rows = [view.rows(table, number, since_s, until_s, question.points + 1) for number in known]
    answer = _aligned(question, table, max(PERIODS_S[table], _step(question)), known, rows)
    if len(answer.t) <= question.points:
        return answer
    # Do not split an answer at the start of a gap, which would hide the gap.
    after_gap = question.points > 1 and not any(c.rows.n[question.points] for c in answer.courses)
    cut = question.points - after_gap
    first = slice(cut)
    courses = tuple(course._replace(rows=course.rows.select(first)) for course in answer.courses)
    following = int(answer.t[cut])
    return answer._replace(t=answer.t[first], courses=courses, next_s=following)


def _aligned(
    question: Question, table: Resolution, step_s: int, known: Mapping[int, HistorySeries], rows: Sequence[HistoryRows]
) -> HistoryAnswer:
    t, courses = aligned(rows, step_s, _GAP_STEPS * max(step_s, question.interval_s))
    found = zip(known.values(), courses, strict=True)
    return HistoryAnswer(table, step_s, t, tuple(ParameterRows(*course) for course in found))
