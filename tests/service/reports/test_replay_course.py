"""The course of an axis, decimated while it runs, and the line of times that it is drawn on."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor_core.arrays import Ints
from monitor_core.detection import Crossing
from monitor_core.detection.multimodel.multimodel_detector import MultiModelDetector, MultiModelThresholds
from monitor_core.kernel.admission import DOUBTED, GATED, IDLE, RESTART, SEED, SETTLE, SKIP, TRACK
from monitor_core.kernel.block import Trace
from monitor_core.kernel.state import COUNTERS
from monitor_core.monitoring import UNSEEN, AxisMonitor, Fleet, standard_deviation
from monitor_core.samples import SampleBlock
from monitor_core.sampling import DROP_REASONS as DROPPED
from monitor_core.settings import Threshold
from service.can.decoder import FRAME_REASONS
from service.ingest.samples.unwrap import AMBIGUOUS
from service.reports import replay_course as rows
from service.reports.replay_course import SIGMAS, ReplayCourse
from service.reports.replay_html import REASONS
from service.reports.replay_report import dated
from service.reports.timeline import PAUSE_S, Timeline, time_unit
from tests.core.cases import BY_NAME, record

SAMPLES = 3000
FAULT = 1500
COUNTED = {
    "used": TRACK,
    "seeding": SEED,
    "settling": SETTLE,
    "gated": GATED,
    "outlier": DOUBTED,
    "starved": IDLE,
}


class Ran:
    """A record with jitter, gaps, an outlier, a closed gate and a fault, all of its values kept, and its course."""

    def __init__(self, seed: int, most: int, cuts: list[int]) -> None:
        case = BY_NAME["paper"]
        self.block = self.make_block(seed)
        own = tuple(Threshold(a, 0.4, w) for a, w in ((0.3, 0.0), (0.2, 0.001), (0.3, 0.0)))
        settings = case.settings(relative_sd=0.05, outlier_limit=6.0, min_excitation=0.05, information_floor=0.05)
        settings = replace(settings, thresholds=own)
        fleet = Fleet([case.model], [settings])
        self.monitor: AxisMonitor = fleet.monitors[0]
        self.course = ReplayCourse(self.monitor, most)
        self.crossings: list[Crossing] = []
        traces: list[Trace] = []
        for a, b in pairwise([0, *sorted(cuts), SAMPLES]):
            part = SampleBlock(*(None if v is None else v[a:b] for v in self.block))  # type: ignore[arg-type]
            trace = fleet.update({0: part}, traced=True)[0].trace
            assert trace is not None
            self.course.take(part.t_us, trace.estimator, trace.crossings)
            self.crossings += trace.crossings
            traces.append(trace.estimator)
        self.trace = Trace(*(np.concatenate(fields) for fields in zip(*traces, strict=True)))

    @staticmethod
    def make_block(seed: int) -> SampleBlock:
        case = BY_NAME["paper"]
        before = record(seed, case, FAULT, jitter=0.3, gaps=2)
        after = record(seed + 1, case, SAMPLES - FAULT, true={**case.values, "kT": 1.5})
        t = np.concatenate([before.t_us, before.t_us[-1] + 200_000_000 + after.t_us])
        u, y = (np.concatenate([a, b]) for a, b in ((before.u, after.u), (before.y, after.y)))
        y[[400, 1000, 1400]] += 1e3  # while the predictor settles after a gap, nothing is judged an outlier
        y[600] = np.nan
        shift = np.zeros((SAMPLES, 3))
        shift[300:500, 2] = 0.004
        gate = np.ones(SAMPLES, np.bool_)
        gate[800:900] = False
        return SampleBlock(t, u, y, shift, gate)

    @property
    def took(self) -> NDArray[np.bool_]:
        return np.asarray(self.trace.mode != SKIP)


@pytest.fixture(scope="module")
def ran(seed: int) -> Ran:
    return Ran(seed, 64, [7, 700, 701, 1800])


def test_the_trace_has_the_fate_of_each_sample(ran: Ran) -> None:
    counts = dict(zip(COUNTERS, ran.monitor.batch.state.counts[:, 0].tolist(), strict=True))
    assert counts == dict(ran.monitor.status().counters)
    for name, fate in COUNTED.items():
        assert np.count_nonzero(ran.trace.mode == fate) == counts[name], name
    assert np.count_nonzero(ran.trace.mode == RESTART) == counts["started"] + counts["gap"] > 2
    assert np.count_nonzero(~ran.took) == counts["not_finite"] == 1
    assert counts["gated"] > 50
    assert counts["outlier"] >= 1
    assert (ran.trace.shift[ran.took] == ran.block.shift[ran.took]).all()  # type: ignore[index]
    assert (ran.trace.observed[-1] == ran.monitor.batch.state.observed[:, 0]).all()


def test_bins_hold_the_least_and_the_largest_values(ran: Ran) -> None:
    c, took, model, s = ran.course, ran.took, ran.monitor.model, ran.monitor.settings
    where = Timeline().take(ran.block.t_us[took])
    bins = np.searchsorted(c.edges, where * 1e-6 + 1e-9) - 1
    assert 32 <= c.used <= 64
    nominal = model.theta0 + ran.trace.shift[took]
    P, g = ran.trace.P[took], ran.trace.g[took]
    sd = np.vectorize(lambda P_ii: standard_deviation(s, P_ii))(P)
    nu = np.array([t.alpha1 for t in s.thresholds]) * np.sqrt(s.lam0 * P)
    nu += np.array([t.allowance for t in s.thresholds]) * model.scale
    theta = ran.trace.theta[took]
    low = {rows.ESTIMATE: theta, rows.BELOW: theta - SIGMAS * sd, rows.NOMINAL: nominal}
    low |= {rows.TOLERATED_BELOW: nominal - nu, rows.UP: g[:, 0], rows.DOWN: g[:, 1]}
    high = {rows.ESTIMATE: theta, rows.ABOVE: theta + SIGMAS * sd, rows.NOMINAL: nominal}
    high |= {rows.TOLERATED_ABOVE: nominal + nu}
    for k in range(c.used):
        inside = bins == k
        for found, values, extreme in ((c.low, low, np.min), (c.high, high, np.max)):
            for row, series in values.items():
                for i, name in enumerate(c.h):
                    want = extreme(series[inside, i]) if inside.any() else np.nan
                    assert found(row, name)[k] == pytest.approx(want, rel=1e-12, nan_ok=True)
        for i, name in enumerate(c.h):
            mean = theta[inside, i].mean() if inside.any() else np.nan
            assert c.mean(name)[k] == pytest.approx(mean, nan_ok=True)
        for fate in (TRACK, GATED, SETTLE, RESTART):
            assert c.fate(fate)[k] == np.count_nonzero(ran.trace.mode[took][inside] == fate)
        for i, name in enumerate(c.h):
            tested = (ran.trace.mode[took] == TRACK) & (ran.trace.observed[took, i] != UNSEEN)
            assert c.tested(name)[k] == tested[inside].any()
    assert 0 < c.tested("kT").sum() < c.used
    assert c.unseen("kT").sum() == np.count_nonzero(ran.trace.observed[took, 0] == UNSEEN)
    assert next(iter(c.h)) == "kT"


def test_no_crossing_is_lost(ran: Ran) -> None:
    """g has started again at that very sample: without care it would nowhere reach h."""
    c = ran.course
    assert len(ran.crossings) > 3
    assert {crossing.parameter for crossing in ran.crossings} >= {"kT"}
    for crossing in ran.crossings:
        h, at = c.h[crossing.parameter], c.timeline.find(crossing.time_us)
        assert at is not None
        g = c.high(rows.UP if crossing.direction == "up" else rows.DOWN, crossing.parameter)
        assert g[int(np.searchsorted(c.edges, at + 1e-9)) - 1] >= h
        assert c.largest(rows.UP, rows.DOWN, name=crossing.parameter) >= h
    quiet = set(c.h) - {crossing.parameter for crossing in ran.crossings}
    assert all(c.largest(rows.UP, rows.DOWN, name=name) <= c.h[name] for name in quiet)


def test_blocks_may_be_cut_anywhere(ran: Ran, seed: int) -> None:
    rng = np.random.default_rng(seed)
    other = Ran(seed, 64, rng.integers(0, SAMPLES, 12).tolist()).course
    for c, d in zip(_all_of(ran.course), _all_of(other), strict=True):
        assert np.allclose(c, d, rtol=1e-12, atol=0, equal_nan=True)
    assert other.timeline.stretches == ran.course.timeline.stretches


def _all_of(course: ReplayCourse) -> Iterator[NDArray[Any]]:
    yield from (course.edges, course.gaps, *(course.fate(fate) for fate in rows.FATES))
    for name in course.h:
        yield from (course.mean(name), course.unseen(name), course.tested(name))
        for kind in range(rows.EVIDENCE):
            yield from (course.low(kind, name), course.high(kind, name))


def test_gaps_are_marked_where_no_samples_were(ran: Ran) -> None:
    c = ran.course
    t = ran.block.t_us[ran.took]
    longest = int(np.argmax(np.diff(t[:FAULT]) > 0.06 * 1e6))
    at = [c.timeline.find(int(v)) for v in (t[longest], t[longest + 1])]
    first, last = (int(np.searchsorted(c.edges, (v or 0.0) + 1e-9)) - 1 for v in at)
    assert c.gaps[first : last + 1].all()
    assert 0 < c.gaps.sum() < c.used / 2


def test_the_multimodel_detector_has_the_same_bins_and_loses_no_crossing(seed: int) -> None:
    case = BY_NAME["paper"]
    block = Ran.make_block(seed)
    beside = MultiModelDetector(case.model, case.settings(outlier_limit=6.0), MultiModelThresholds(1e6))
    fleet = Fleet([case.model], [case.settings(outlier_limit=6.0)], {0: beside}, {0: "multimodel"})
    course = ReplayCourse(fleet.monitors[0], 64)
    g: list[NDArray[np.float64]] = []
    took: list[NDArray[np.bool_]] = []
    tested: list[NDArray[np.bool_]] = []
    changed = 0
    for a, b in pairwise([0, 7, 700, 1800, SAMPLES]):
        part = SampleBlock(*(None if v is None else v[a:b] for v in block))  # type: ignore[arg-type]
        changes, _, trace = fleet.update({0: part}, traced=True)[0]
        changed += len(changes)
        assert trace is not None
        assert trace.multimodel is not None
        course.take(part.t_us, trace.estimator, [], trace.multimodel)
        g.append(trace.multimodel.g)
        tested.append(np.asarray(~np.isnan(trace.multimodel.llr).all(axis=1)))
        took.append(trace.estimator.mode != SKIP)
    assert changed
    share = np.concatenate(g)[np.concatenate(took)] / beside.bank.h
    where = Timeline().take(block.t_us[np.concatenate(took)])
    bins = np.searchsorted(course.edges, where * 1e-6 + 1e-9) - 1
    assert set(course.causes) >= {"kT", "torque sign"}
    for cause in course.causes:
        mine = [k for k, hypothesis in enumerate(beside.bank.hypotheses) if hypothesis.cause == cause]
        largest = share[:, mine].max(axis=1, initial=0.0)
        for k in np.unique(bins).tolist():
            assert course.high(rows.EVIDENCE, cause)[k] == largest[bins == k].max()
            assert course.low(rows.EVIDENCE, cause)[k] == largest[bins == k].min()
    assert max(course.largest(rows.EVIDENCE, name=cause) for cause in course.causes) == share.max() > 1
    ran = np.concatenate(tested)[np.concatenate(took)]
    of_bins = [bool(ran[bins == k].any()) for k in range(course.used)]
    assert course.tested("kT").tolist() == of_bins
    assert 0 < sum(of_bins) < course.used


# --- the line of times --------------------------------------------------------------------------------------


S = 1_000_000
steps = st.lists(st.sampled_from([5_000, 5_000, 4_321, 700_000, 59 * S, 61 * S, 3600 * S, -1, -5 * S]), max_size=30)


def line(t: Ints, cuts: list[int]) -> tuple[Timeline, Ints]:
    """Of samples that came in blocks."""
    timeline = Timeline()
    edges = [0, *sorted(c % (len(t) + 1) for c in cuts), len(t)]
    return timeline, np.concatenate([timeline.take(t[a:b]) for a, b in pairwise(edges)])


@given(steps=steps, cuts=st.lists(st.integers(0, 30), max_size=4), start=st.integers(0, 10**15))
def test_it_goes_on_whatever_the_times_do(steps: list[int], cuts: list[int], start: int) -> None:
    t = start + np.cumsum(np.array([0, *steps], np.int64))
    timeline, where = line(t, cuts)
    known = [0 <= step <= PAUSE_S * 1e6 for step in steps]
    assert where[0] == 0
    assert (np.diff(where) == [step if k else 0 for step, k in zip(steps, known, strict=True)]).all()
    assert timeline.end_us == where[-1]
    assert timeline.start_us == start
    assert timeline.pauses == known.count(False)
    at_once, other = line(t, [])
    assert (where == other).all()
    assert timeline.stretches == at_once.stretches
    for at, time in zip(where.tolist(), t.tolist(), strict=True):
        last = max(w for w, other in zip(where.tolist(), t.tolist(), strict=True) if other == time)
        found = timeline.find(time)
        assert found is not None
        assert found * 1e6 >= last - 0.5 >= at - 0.5  # the latest place of that time


def test_what_a_line_of_times_does_not_have() -> None:
    timeline, _ = line(np.array([0, S, 100 * S, 101 * S]), [])
    assert [timeline.find(t) for t in (None, -1, S // 2, 50 * S, 100 * S, 102 * S)] == [
        *(None, None, 0.5),
        *(None, 1.0, None),
    ]
    assert [round(stretch.pause_s) for stretch in timeline.stretches] == [0, 99]
    assert Timeline().find(0) is None
    timeline, where = line(np.arange(10_000) * 100 * S, [1234])
    assert (timeline.pauses, len(timeline.stretches), where[-1]) == (9_999, 4096, 0)
    case = BY_NAME["paper"]
    empty = ReplayCourse(AxisMonitor(case.model, case.settings()))
    assert (empty.used, empty.edges.size, empty.largest(rows.UP, rows.DOWN, name="kT")) == (0, 1, 0.0)


def test_reasons_and_times_in_words() -> None:
    assert {*COUNTERS, *DROPPED, *FRAME_REASONS, AMBIGUOUS} <= REASONS.keys()
    assert [time_unit(s).name for s in (1, 600, 601, 86_400, 1e6)] == ["s", "s", "min", "h", "d"]
    assert time_unit(9000).written(90.0) == "1.50 min"
    assert [dated(t) for t in (None, 5_000_000, 1_760_000_000_123_456)] == ["", "", "2025-10-09 08:53:20.1"]
