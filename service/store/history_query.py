"""Questions to the history: which resolution answers them, and its rows, merged to the number that is wanted."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple

from monitor_core.arrays import Ints
from service.store.history_rows import NO_ROWS, Rows, aligned, merged
from service.store.history_store import PERIODS_S, RESOLUTIONS, HistoryStore, HistoryView, Resolution, Series

MOST_POINTS = 5000
_DAY_S = 86400
_STEPS_S = (
    *(1, 2, 5, 10, 20, 30, 60, 120, 180, 300, 600, 900, 1200, 1800),
    *(hours * 3600 for hours in (1, 2, 3, 4, 6, 8, 12)),
)
"""Lengths of a row, as on a clock; longer ones are whole days"""
_GAP_STEPS = 1.5
"""Rows that are farther apart have a gap between them."""


@dataclass(frozen=True, slots=True)
class Question:
    """What is wanted.  Times in seconds since 1970; ``until_s`` is not included.

    ``resolution``: its rows as they are, the first ``points`` of them; None: at most ``points`` rows of the whole time.
    ``interval_s``: time between two points when they are recorded.
    """

    axis: str
    interval_s: float
    parameter: str | None = None
    since_s: int | None = None
    until_s: int | None = None
    points: int = 600
    resolution: Resolution | None = None


class Course(NamedTuple):
    """The rows of a parameter."""

    series: Series
    rows: Rows


class HistoryAnswer(NamedTuple):
    """Rows of all parameters on the same times ``t`` (M,) [s since 1970], each ``step_s`` long, oldest first.

    ``next_s``: where the question goes on, as there are more rows; None: there are none.
    """

    resolution: Resolution
    step_s: int
    t: Ints
    courses: tuple[Course, ...]
    next_s: int | None = None


def ask(store: HistoryStore, question: Question) -> HistoryAnswer:
    """The answer to a question.

    Raises:
        StoreError: the file cannot be read.
    """
    with store.read() as view:
        known = view.series(question.axis, question.parameter)
        ends = {table: found for table in RESOLUTIONS if (found := view.ends(table, [*known])) is not None}
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
    """All rows of a resolution, some at a time; without one, of the finest that goes back to ``since_s``."""
    with store.read() as view:
        known = view.series(question.axis, question.parameter)
        ends = {table: found for table in RESOLUTIONS if (found := view.ends(table, [*known])) is not None}
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
    """The time that is asked for, as far as there is anything."""
    finest, *coarser = ends
    first = ends[finest][0]
    for table in coarser:  # an hour of which there are points begins before them: only complete rows count
        first = ends[table][0] if ends[table][0] + PERIODS_S[table] <= first else first
    last = min(begin + PERIODS_S[table] for table, (_, begin) in ends.items())
    since_s = first if question.since_s is None else max(question.since_s, first)
    until_s = last if question.until_s is None else min(question.until_s, last)
    return since_s, until_s


def _step(question: Question) -> int:
    """The length of a row where points are as close as they can be [s]."""
    return max(1, round(question.interval_s))


def _choice(question: Question, since_s: int, until_s: int, ends: _Ends) -> tuple[Resolution, int]:
    """The table to read, and the length of a row."""
    least = _step(question)
    # For a single row the longest one begins at zero: all shorter ones may have a boundary within the range.
    days = range(1, 2 + until_s // _DAY_S)
    steps = (s for s in chain((least, *_STEPS_S), (_DAY_S * d for d in days)) if s >= least)
    step_s = next((s for s in steps if _number(since_s, until_s, s) <= question.points), least)
    finest = next(t for t in reversed(RESOLUTIONS) if step_s % PERIODS_S[t] == 0)
    table = _reaching(finest, since_s, ends)
    return table, max(step_s, PERIODS_S[table])


def _number(since_s: int, until_s: int, step_s: int) -> int:
    return (until_s - 1) // step_s - since_s // step_s + 1


def _reaching(table: Resolution, since_s: int, ends: _Ends) -> Resolution:
    """This table, or the finest coarser one that goes back to ``since_s``, as far as any does."""
    for coarser in RESOLUTIONS[RESOLUTIONS.index(table) + 1 :]:
        if coarser not in ends:
            continue
        period = PERIODS_S[coarser]
        first = max(ends[coarser][0], since_s // period * period)
        begin = ends[table][0] if table in ends else first + period
        has_more = (
            since_s < begin and first + period <= begin
        )  # rows of a time of which the finer one has none
        if has_more:
            table = coarser
    return table


def _as_stored(
    view: HistoryView, question: Question, known: Mapping[int, Series], table: Resolution
) -> HistoryAnswer:
    since_s = 0 if question.since_s is None else question.since_s // PERIODS_S[table] * PERIODS_S[table]
    until_s = 1 << 62 if question.until_s is None else question.until_s
    rows = [view.rows(table, number, since_s, until_s, question.points + 1) for number in known]
    answer = _aligned(question, table, max(PERIODS_S[table], _step(question)), known, rows)
    if len(answer.t) <= question.points:
        return answer
    after_gap = question.points > 1 and not any(c.rows.n[question.points] for c in answer.courses)
    cut = question.points - after_gap  # a gap does not begin between two answers, which would hide it
    first = slice(cut)
    courses = tuple(course._replace(rows=course.rows.select(first)) for course in answer.courses)
    following = int(answer.t[cut])
    return answer._replace(t=answer.t[first], courses=courses, next_s=following)


def _aligned(
    question: Question, table: Resolution, step_s: int, known: Mapping[int, Series], rows: Sequence[Rows]
) -> HistoryAnswer:
    t, courses = aligned(rows, step_s, _GAP_STEPS * max(step_s, question.interval_s))
    found = zip(known.values(), courses, strict=True)
    return HistoryAnswer(table, step_s, t, tuple(Course(*course) for course in found))
