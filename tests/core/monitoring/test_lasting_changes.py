"""One change, one alarm: on an axis that the model does not match, where small changes hardly stand out."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from monitor_core.detection.alarm import Onset
from monitor_core.monitoring import AlarmChange, AlarmLife, AlarmRules, due, is_present
from tests.core.lasting_changes import chattering, courses

LASTING_S, REPAIRED_S = 240.0, 90.0
OFF_DELAY_US = 30_000_000
times = st.integers(-(10**18), 10**18)
ends = times | st.none()


@given(times, times, times)
def test_an_onset_in_its_interval_stays(a: int, b: int, c: int) -> None:
    low, best, high = sorted((a, b, c))
    assert Onset.within(best, low, high) == Onset(best, low, high)


@given(times, ends, ends, times)
def test_an_onset_lies_in_its_interval_and_is_not_later_than_the_alarm(
    best_us: int, low_us: int | None, high_us: int | None, raised_us: int
) -> None:
    onset = Onset.within(best_us, low_us, high_us)
    sooner = onset.until(raised_us)
    for found in (onset, sooner):
        assert found.onset_low_us is None or found.onset_low_us <= found.onset_us
        assert found.onset_high_us is None or found.onset_us <= found.onset_high_us
    assert (onset.onset_low_us is None, onset.onset_high_us) == (low_us is None, high_us)
    assert max(sooner.onset_us, sooner.onset_high_us or sooner.onset_us) <= raised_us
    if max(onset.onset_us, onset.onset_high_us or 0) <= raised_us:
        assert sooner == onset


def test_a_lasting_change_is_one_alarm_with_its_size(seed: int) -> None:
    """Of two changes; tests/soak/test_lasting_changes.py has all of them."""
    for course in courses(seed, LASTING_S, REPAIRED_S, [("kT", 0.8), ("fm", 1.3)]):
        (alarm,) = course.alarms
        assert (alarm.parameter, alarm.direction) == (course.parameter, "up" if course.size > 0 else "down")
        assert alarm.reopened_us is None
        assert alarm.ended_us is not None
        assert alarm.ended_us > course.repaired_us
        for _, form in course.changes:
            assert (form.size is None) == (form.size_sd is None) == (form.stage == "changed")
            low, high = form.onset_low_us, form.onset_high_us
            assert low is None or low <= form.onset_us
            assert high is None or form.onset_us <= high
            assert form.onset_us <= form.raised_us
        sized = course.sized
        assert sized is not None
        assert sized.size is not None
        assert sized.size_sd is not None
        print(f"{course.parameter}: {sized.size:.4g} +- {sized.size_sd:.2g}, true {course.size:.4g}")
        assert abs(sized.size - course.size) < 3 * sized.size_sd


def test_a_chattering_axis_has_one_alarm_that_is_announced_once(seed: int) -> None:
    """kT changes each half minute, and comes back: one alarm of the tracker, which the off-delay raises once."""
    changes = chattering(seed)
    assert len({change.alarm.key for change in changes}) == 1
    back = [(before.alarm.ended_us, change) for before, change in pairwise(changes) if change.kind == "reopened"]
    assert len(back) >= 3
    late = sum(change.alarm.updated_us - (ended_us or 0) >= OFF_DELAY_US for ended_us, change in back)
    assert late <= 1  # a time that was not found, between two others
    assert events_of(changes, OFF_DELAY_US / 1e6) == ["raise", "clear"] * (1 + late)
    assert events_of(changes, 0.0).count("raise") == 1 + len(back)


def events_of(changes: list[AlarmChange], off_delay_s: float) -> list[str]:
    """The transitions of the alarm of these changes, each looked at when it happens, and a minute later."""
    rules, events = AlarmRules(off_delay_s=off_delay_s), list[str]()
    life, ended_us = AlarmLife(), changes[0].alarm.ended_us
    times = [max(a.updated_us, a.since_us, a.ended_us or 0) for _, a in changes]
    forms = [(a.ended_us, t) for (_, a), t in zip(changes, times, strict=True)]
    for now_ended_us, now_us in (*forms, (forms[-1][0], times[-1] + 60_000_000)):
        for seen_us in (ended_us, now_ended_us):  # until now, and from now on
            found = due(life, is_present(life, seen_us, now_us, rules), rules)
            events += [str(change.event) for change in found]
            life = found[-1].after if found else life
        ended_us = now_ended_us
    return events
