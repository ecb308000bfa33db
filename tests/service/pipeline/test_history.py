"""Points of the history."""

from dataclasses import replace

from monitor_core.modeling.standard_drives import reference_model
from monitor_core.monitoring import AxisMonitor, AxisStatus
from monitor_core.settings import Settings
from service.pipeline.publishing import RecentHistory
from service.pipeline.worker import BOUNDS_S, ProcessingTime

FACTS = AxisMonitor(reference_model(), Settings.paper(interval_s=0.005)).status()


def at(t_us: int | None) -> AxisStatus:
    return replace(FACTS, time_us=t_us)


def times(keeper: RecentHistory) -> list[int]:
    return [point.time_us for point in keeper.history.points]


def test_a_point_each_interval_of_the_samples_time() -> None:
    keeper = RecentHistory(1.0, 3600.0)
    for t_us in (None, 0, 400_000, 999_999, 1_000_000, 1_100_000, 5_000_000):
        keeper.add(at(t_us))
    assert times(keeper) == [0, 1_000_000, 5_000_000]


def test_a_clock_set_back_leaves_no_hole() -> None:
    keeper = RecentHistory(1.0, 3600.0)
    for t_us in (10_000_000, 2_000_000, 2_500_000, 3_000_000):
        keeper.add(at(t_us))
    assert times(keeper) == [10_000_000, 2_000_000, 3_000_000]


def test_the_length_is_there_and_not_much_more() -> None:
    keeper = RecentHistory(0.5, 100.0)
    for k in range(1000):
        keeper.add(at(k * 500_000))
        assert len(times(keeper)) >= min(k + 1, 200)
    assert len(times(keeper)) <= 200 + 2 * 60


def test_processing_times_are_counted_by_their_upper_bounds() -> None:
    time = ProcessingTime()
    for duration_s in (0.0, BOUNDS_S[0], BOUNDS_S[0] * 1.01, 1e9):
        time.observe(duration_s)
    found = time.histogram()
    assert (found.counts[0], found.counts[1], found.counts[-1]) == (2, 1, 1)
    assert len(found.counts) == len(found.bounds) + 1
