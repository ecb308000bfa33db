"""The alarms of an axis: raised, named, corrected, merged, doubted, ended, reopened; with evidence written by hand."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.detection import Alarm, Crossing, FormerName
from monitor_core.detection.alarm import MODEL_ERROR, Direction
from monitor_core.detection.cusum.cusum_detector import CusumDetector
from monitor_core.detection.cusum.cusum_evidence import CusumEvent, Evidence
from monitor_core.detection.onset import Past
from monitor_core.monitoring import AlarmChange
from monitor_core.monitoring.alarm_tracker import AlarmTracker

NAMES = ("kT", "1/Ja", "fm")
TOLERANCE = 4.2
OLD_US, REOPEN_US, NAMELESS_US = 11, 100, 300
"""Three memory lengths, after which a crossing is old, and the times in which an alarm with and one without a name is
reopened."""


class Book(AlarmTracker):
    """Open alarms, fed with events of the CUSUM tests."""

    def __init__(self) -> None:
        super().__init__(reopen_us=REOPEN_US, nameless_us=NAMELESS_US)

    def changes(self, event: CusumEvent) -> list[AlarmChange]:
        return self.update([event], CusumDetector.interpret)

    def take(self, event: CusumEvent) -> list[Alarm]:
        return [change.alarm for change in self.changes(event)]


def crossing(parameter: str, time_us: int, direction: Direction = "up") -> Crossing:
    return Crossing(parameter, direction, time_us, time_us - 5)


def evidence(
    time_us: int, *d: float, r: float = 0.0, excess: float = 1.0, held: tuple[int, int, int] = (0, 0, 0)
) -> Evidence:
    """Deviations in standard deviations; kT and fm are correlated by r."""
    V = np.array(((1.0, 0.0, r), (0.0, 1.0, 0.0), (r, 0.0, 1.0)))
    t_us = time_us + np.arange(-OLD_US, 1, dtype=np.int64)
    nothing_learned = Past(t_us, np.zeros((12, 3)), np.ones((12, 3, 3)), 0.9, 1.0, 0.0)
    return Evidence(
        time_us, NAMES, np.array(d), V, np.zeros((3, 3)), TOLERANCE, excess, held, nothing_learned, OLD_US + 1
    )


def names(book: Book) -> list[tuple[str, str, str]]:
    return [(e.parameter, e.direction, e.stage) for e in book.open]


def named(*d: float, r: float = 0.0) -> tuple[Book, Alarm]:
    """A book with one alarm, raised by kT at 10 and named at 20."""
    book = Book()
    book.take(crossing("kT", 10))
    (e,) = book.take(evidence(20, *d, r=r))
    return book, e


def test_a_wrong_first_crossing_is_one_alarm_whose_name_is_corrected() -> None:
    book = Book()
    (raised,) = book.take(crossing("fm", 10))
    assert (raised.stage, raised.causes, raised.onset_us) == ("changed", (), 5)
    (joined,) = book.take(crossing("kT", 12, "down"))
    assert (joined.parameter, joined.crossings) == ("fm", 2)
    assert {raised.size, raised.size_sd, joined.size, joined.size_sd} == {None}
    (e,) = book.take(evidence(20, -10.0, 0.5, 1.0))
    assert (e.parameter, e.direction, e.stage, e.raised_us, e.first) == (
        "kT",
        "down",
        "named",
        10,
        ("fm", "up"),
    )
    assert e.past == (FormerName(20, "changed", "fm", "up"),)
    assert [e.size, e.size_sd] == pytest.approx([-10, np.hypot(1, 10 * MODEL_ERROR)])
    assert [cause.parameter for cause in e.causes] == ["kT"]
    assert e.doubt == ""
    (ended,) = book.take(evidence(31, -0.5, 0.5, 1.0))
    assert (ended.ended_us, ended.first, book.open) == (31, ("fm", "up"), ())


def test_without_an_alarm_evidence_says_nothing() -> None:
    assert Book().take(evidence(5, 10.0, 0.0, 0.0)) == []


def test_what_does_not_stand_out_gets_no_name_yet() -> None:
    book = Book()
    book.take(crossing("kT", 10))
    assert book.take(evidence(20, 3.0, 0.0, 0.0)) == []
    assert names(book) == [("kT", "up", "changed")]
    book.take(evidence(30, 6.0, 0.0, 0.0))
    assert names(book) == [("kT", "up", "named")]


def test_what_never_stands_out_ends_when_it_no_longer_crosses() -> None:
    book = Book()
    book.take(crossing("kT", 10))
    book.take(evidence(20, 3.0, 0.0, 0.0))
    book.take(crossing("kT", 25))
    assert book.take(evidence(30, 3.0, 0.0, 0.0)) == []
    assert book.take(evidence(40, 3.0, 0.0, 0.0)) == []  # a small change would look like that
    (ended,) = book.take(evidence(50, 0.9, 0.0, 0.0))
    assert (ended.ended_us, ended.stage) == (50, "changed")


def test_ambiguity_is_told_as_probabilities() -> None:
    """Correlated by 0.99, kT +2 and fm -2 are kT +4, or fm -4, and errors in both; kT crossed, which is 8 to 1."""
    _, e = named(2.0, 0.0, -2.0, r=0.99)
    assert [cause.parameter for cause in e.causes] == ["kT", "fm"]
    assert [cause.probability for cause in e.causes] == pytest.approx([8 / 9, 1 / 9])
    assert (e.direction, e.doubt) == ("up", "")
    assert e.size == pytest.approx(4, abs=0.1)
    assert named(1.5, 0.0, -2.6, r=0.99)[1].parameter == "fm"


def test_what_no_single_parameter_explains_is_said() -> None:
    _, e = named(10.0, 9.0, 0.0)
    assert (e.parameter, e.doubt) == ("kT", "several")


def test_a_second_fault_is_named_given_the_first() -> None:
    book, _ = named(10.0, 0.0, 0.0)
    assert book.take(crossing("fm", 30)) == []
    assert [(a.parameter, a.stage) for a in book.unreported] == [("fm", "changed")]
    kinds = [(c.kind, c.alarm.parameter, c.alarm.raised_us) for c in book.changes(evidence(40, 10.0, 0.0, 8.0))]
    assert kinds == [("raised", "fm", 30), ("updated", "kT", 10)]
    assert names(book) == [("kT", "up", "named"), ("fm", "up", "named")]
    first, second = book.open
    assert [cause.parameter for cause in second.causes] == ["fm"]
    assert [first.size, second.size] == pytest.approx([10, 8])


def test_the_first_fault_may_be_off_by_anything_when_the_second_is_named() -> None:
    book, _ = named(20.0, 0.0, 1.0, r=0.5)
    book.take(crossing("1/Ja", 30))
    book.take(evidence(40, 35.0, 10.0, 2.0, r=0.5))
    assert names(book) == [("kT", "up", "named"), ("1/Ja", "up", "named")]


def test_a_crossing_that_the_first_explains_ends_with_it() -> None:
    book, _ = named(10.0, 0.0, 0.0)
    assert book.take(crossing("fm", 30)) == []
    (first,) = book.take(evidence(40, 10.0, 0.0, 1.0))
    assert (first.parameter, first.ended_us, first.crossings) == ("kT", None, 2)
    assert book.unreported == ()
    assert names(book) == [("kT", "up", "named")]


def test_two_alarms_that_one_other_parameter_explains_become_one() -> None:
    book, _ = named(2.0, 0.0, -1.98, r=0.99)
    assert names(book) == [("kT", "up", "named")]
    book.take(crossing("fm", 30, "down"))
    changed = book.take(evidence(40, 0.0, 0.0, -4.0, r=0.99))
    assert [(e.parameter, e.ended_us) for e in changed] == [("fm", None)]
    assert names(book) == [("fm", "down", "named")]
    assert book.open[0].first == ("kT", "up")
    assert [name.stage for name in book.open[0].past] == ["changed", "named"]


def test_a_name_is_corrected_when_later_evidence_rules_it_out() -> None:
    book, _ = named(2.0, 0.0, -1.98, r=0.99)
    (still,) = book.take(evidence(40, 2.0, 0.0, -2.04, r=0.99))
    assert still.parameter == "kT"
    (e,) = book.take(evidence(60, 0.0, 0.0, -4.0, r=0.99))
    assert e.parameter == "fm"
    assert book.open == (e,)


def test_crossings_of_its_own_and_evidence_update_the_size() -> None:
    book, _ = named(10.0, 0.0, 0.0)
    (e,) = book.take(crossing("kT", 25))
    assert (e.crossings, e.stage, e.updated_us) == (2, "named", 25)
    assert e.size == pytest.approx(10.0)
    (e,) = book.take(evidence(40, 12.0, 0.0, 0.0))
    assert e.size == pytest.approx(12)


def test_an_alarm_lasts_until_the_parameter_is_nearer_to_its_nominal_value_than_to_the_size() -> None:
    """With a standard deviation of 1 the nominal value is 100 times as likely as 6 where (6^2 - 12 d) / 2 > log 100."""
    book, _ = named(10.0, 0.0, 0.0)
    for time_us, d in ((40, 6.0), (52, 2.9), (64, 2.3)):
        (e,) = book.take(evidence(time_us, d, 0.0, 0.0))
        assert e.ended_us is None
        assert e.size == pytest.approx(6.0)  # nearer to nominal, it waits for the end
    (e,) = book.take(evidence(76, 2.0, 0.0, 0.0))
    assert e.ended_us == 76
    assert e.size == pytest.approx(6.0)


def past_of(value: Floats, sd: float, r: float = 0.0) -> Past:
    """Stretches (N, 3) up to the time 100, of this standard deviation; kT and fm are correlated by r."""
    d, lam, N = value.copy(), 0.8, len(value)
    for k in range(1, N):
        d[k] = lam * d[k - 1] + (1 - lam) * value[k]
    V = sd**2 * np.array(((1.0, 0.0, r), (0.0, 1.0, 0.0), (r, 0.0, 1.0)))
    return Past(np.arange(101 - N, 101, dtype=np.int64), d, np.tile((1 - lam) * V, (N, 1, 1)), lam, 1.0, 0.0)


@pytest.mark.parametrize(("sd", "size"), [(1.0, 10.0), (25.0, 10.0 * 50 / 59)])
def test_the_size_is_that_while_the_cause_lasted(sd: float, size: float) -> None:
    """kT was off by 10 for fifty stretches and has been back for nine, though its tests have crossed since.

    Where the stretches scatter by more than that, chance looks the same, and all of them count.
    """
    book, _ = named(10.0, 0.0, 0.0)
    book.take(crossing("kT", 98))
    value = np.zeros((60, 3))
    value[:51, 0] = 10.0
    value[:, 0] += np.tile([0.3, -0.3], 30)
    (e,) = book.take(replace(evidence(100, *value[-1]), past=past_of(value, sd)))
    assert e.ended_us is None
    assert e.size == pytest.approx(size, abs=0.1)
    assert e.size_sd == pytest.approx(np.hypot(MODEL_ERROR * size, sd / np.sqrt(54)), rel=0.1)


def test_the_cause_that_is_back_keeps_its_size_beside_another_one() -> None:
    book, _ = named(10.0, 0.0, 0.0, r=-0.9)
    book.take(crossing("fm", 30))
    book.take(evidence(42, 10.0, 0.0, 5.0, r=-0.9))
    book.take(crossing("fm", 98))
    value = np.zeros((60, 3))
    value[:, 0], value[:51, 2] = 10.0, 5.0
    kT, fm = book.take(replace(evidence(100, 10.0, 0.0, 0.0, r=-0.9), past=past_of(value, 1.0, r=-0.9)))
    assert (kT.parameter, fm.parameter) == ("kT", "fm")
    assert kT.size == pytest.approx(10.0, abs=0.1)
    assert fm.size == pytest.approx(5.0, abs=0.1)


def test_an_alarm_does_not_end_while_its_tests_cross() -> None:
    book, _ = named(10.0, 0.0, 0.0)
    book.take(crossing("kT", 35))
    (e,) = book.take(evidence(40, 0.0, 0.0, 0.0))
    assert e.ended_us is None


def ended_alarm() -> Book:
    """kT was named at 20 and is back at 40."""
    book, _ = named(10.0, 0.0, 0.0)
    book.take(evidence(40, 0.0, 0.0, 0.0))
    assert book.open == ()
    return book


def test_the_same_cause_soon_after_the_end_is_the_same_alarm() -> None:
    book = ended_alarm()
    assert book.take(crossing("fm", 60)) == []
    (change,) = book.changes(evidence(70, 8.0, 0.0, 0.0))
    e = change.alarm
    assert (change.kind, e.parameter, e.key) == ("reopened", "kT", (10, "kT", "up"))
    assert (e.onset_us, e.reopened_us, e.ended_us, e.crossings) == (5, 60, None, 2)
    assert e.size == pytest.approx(8.0)
    (e,) = book.take(evidence(90, 0.0, 0.0, 0.0))
    assert (e.key, e.ended_us) == ((10, "kT", "up"), 90)


def test_the_time_of_the_crossing_decides_however_late_the_name_comes() -> None:
    book = ended_alarm()
    assert book.take(crossing("fm", 40 + REOPEN_US)) == []
    (change,) = book.changes(evidence(60 + REOPEN_US, 8.0, 0.0, 0.0))
    assert (change.kind, change.alarm.key) == ("reopened", (10, "kT", "up"))
    assert change.alarm.reopened_us == 40 + REOPEN_US
    late = ended_alarm()
    assert [a.stage for a in late.take(crossing("fm", 41 + REOPEN_US))] == ["changed"]


def nameless_alarm() -> Book:
    """A test of kT crossed at 10, and nothing was found at 30."""
    book = Book()
    book.take(crossing("kT", 10))
    (e,) = book.take(evidence(30, 0.0, 0.0, 0.0))
    assert (e.stage, e.ended_us) == ("changed", 30)
    return book


def test_a_test_that_crosses_now_and_then_is_one_alarm_without_a_name() -> None:
    """As of another payload, which shows in some motions only; soon after its end nothing is reported at all."""
    book = nameless_alarm()
    assert book.take(crossing("kT", 30 + REOPEN_US)) == []
    assert book.take(evidence(50 + REOPEN_US, 0.0, 0.0, 0.0)) == []
    time_us = 30
    for crossings in (2, 3):
        time_us += NAMELESS_US
        (change,) = book.changes(crossing("kT", time_us))
        e = change.alarm
        assert (change.kind, e.key, e.reopened_us) == ("reopened", (10, "kT", "up"), time_us)
        assert e.crossings == crossings
        time_us += 20
        book.take(evidence(time_us, 0.0, 0.0, 0.0))
        assert book.open == ()
    (change,) = book.changes(crossing("kT", time_us + NAMELESS_US + 1))
    assert change.kind == "raised"


@pytest.mark.parametrize(("parameter", "direction"), [("fm", "up"), ("kT", "down")])
def test_another_test_or_direction_after_an_alarm_without_a_name_is_another_alarm(
    parameter: str, direction: Direction
) -> None:
    book = nameless_alarm()
    (change,) = book.changes(crossing(parameter, 31 + REOPEN_US, direction))
    assert (change.kind, change.alarm.raised_us) == ("raised", 31 + REOPEN_US)


def test_the_name_of_a_reopened_alarm_comes_with_its_onset() -> None:
    """It had none before, so its first onset may be that of something else."""
    book = nameless_alarm()
    book.take(crossing("kT", 190))
    changed = past_of(np.where(np.arange(60)[:, np.newaxis] >= 48, [10.0, 0.0, 0.0], 0.0), 1.0)
    (e,) = book.take(replace(evidence(200, 10.0, 0.0, 0.0), past=changed._replace(t_us=changed.t_us + 100)))
    assert (e.stage, e.key) == ("named", (10, "kT", "up"))
    assert 180 < e.onset_us <= 190


def test_the_same_cause_beside_another_alarm_is_reopened_once() -> None:
    book = ended_alarm()
    book.take(crossing("fm", 45))
    book.take(evidence(55, 0.0, 0.0, 9.0))
    book.take(crossing("kT", 60))
    changes = book.changes(evidence(70, 8.0, 0.0, 9.0))
    assert [(c.kind, c.alarm.key) for c in changes] == [
        ("reopened", (10, "kT", "up")),
        ("updated", (45, "fm", "up")),
    ]
    assert names(book) == [("fm", "up", "named"), ("kT", "up", "named")]
    assert len(book.take(evidence(75, 8.0, 0.0, 9.0))) == 2


@pytest.mark.parametrize(("time_us", "d"), [(60, (0.0, 0.0, 9.0)), (60, (-9.0, 0.0, 0.0)), (200, (9.0, 0.0, 0.0))])
def test_another_cause_or_direction_or_a_later_time_is_another_alarm(
    time_us: int, d: tuple[float, float, float]
) -> None:
    book = ended_alarm()
    book.take(crossing("kT", time_us, "up"))
    changes = book.changes(evidence(time_us + 10, *d))
    assert changes[-1].alarm.raised_us == time_us
    assert changes[-1].kind == ("renamed" if time_us == 200 else "raised")
    assert len(book.open) == 1


def test_what_belongs_to_an_ended_alarm_and_gets_no_name_is_not_reported() -> None:
    book = ended_alarm()
    assert book.take(crossing("fm", 60)) == []
    assert book.take(evidence(75, 0.0, 0.0, 1.0)) == []
    assert (book.open, book.unreported) == ((), ())


def test_a_saved_book_goes_on_as_before() -> None:
    book = ended_alarm()
    book.take(crossing("fm", 60))
    again = AlarmTracker((*book.ended, *book.open), book.unreported, REOPEN_US, NAMELESS_US)
    found = evidence(70, 8.0, 0.0, 0.0)
    assert again.update([found], CusumDetector.interpret) == book.changes(found)


@pytest.mark.parametrize(
    ("held", "excess", "doubt"),
    [
        ((-1, 0, 0), 10.0, "sign"),
        ((-1, 0, 0), 0.5, "still"),
        ((1, 0, 0), 1.0, "model"),
        ((0, 0, 0), 500.0, "model"),
    ],
)
def test_sensors_are_suspected_and_raise_one_alarm_only(held: tuple[int, int, int], excess: float, doubt: str) -> None:
    book = Book()
    book.take(crossing("kT", 10, "down" if held[0] < 0 else "up"))
    (e,) = book.take(evidence(20, 20.0 if held[0] >= 0 else -20.0, 3.0, 4.0, held=held, excess=excess))
    assert e.doubt == doubt
    assert book.take(crossing("fm", 30)) == []
    book.take(evidence(40, 20.0 if held[0] >= 0 else -20.0, 9.0, 9.0))
    assert book.open[0].doubt == doubt
    assert len(book.open) == 1
