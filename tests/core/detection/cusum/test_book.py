"""The alarms of an axis: raised, named, corrected, merged, doubted, ended; with evidence written by hand."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.detection import Alarm, Crossing, Direction, Evidence, Name, Recovered
from monitor_core.detection.cusum.cusum_detector import CusumDetector
from monitor_core.detection.cusum.cusum_evidence import CusumEvent
from monitor_core.detection.onset import Past
from monitor_core.monitoring import AlarmTracker

NAMES = ("kT", "1/Ja", "fm")
NOTHING = Past(np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3, 3)), 0.9, np.zeros(3), 1.0, 0.0)
TOLERANCE = 4.2


class Book(AlarmTracker):
    """Open alarms, fed with events of the CUSUM tests."""

    def take(self, event: CusumEvent) -> list[Alarm]:
        return [change.alarm for change in self.update([event], CusumDetector.interpret)]


def crossing(parameter: str, time_us: int, direction: Direction = "up") -> Crossing:
    return Crossing(parameter, direction, time_us, time_us - 5, 1.0, 0.1)


def evidence(
    time_us: int, *d: float, r: float = 0.0, excess: float = 1.0, held: tuple[int, int, int] = (0, 0, 0)
) -> Evidence:
    """Deviations in standard deviations; kT and fm are correlated by r."""
    V = ((1.0, 0.0, r), (0.0, 1.0, 0.0), (r, 0.0, 1.0))
    return Evidence(time_us, NAMES, d, V, d, V, TOLERANCE, excess, held, NOTHING)


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
    (e,) = book.take(evidence(20, -10.0, 0.5, 1.0))
    assert (e.parameter, e.direction, e.stage, e.raised_us, e.first) == (
        "kT",
        "down",
        "named",
        10,
        ("fm", "up"),
    )
    assert e.past == (Name(20, "changed", "fm", "up"),)
    assert [e.size, e.size_sd] == pytest.approx([-10, 1])
    assert [cause.parameter for cause in e.causes] == ["kT"]
    assert e.doubt == ""
    assert book.take(Recovered("fm", 30)) == []
    (ended,) = book.take(Recovered("kT", 31))
    assert (ended.ended_us, ended.first, book.open) == (31, ("fm", "up"), ())


def test_without_an_alarm_evidence_says_nothing_and_that_of_the_slow_course_never_names() -> None:
    book = Book()
    assert book.take(evidence(5, 10.0, 0.0, 0.0)) == []
    book.take(crossing("kT", 10))
    assert book.take(replace(evidence(20, 10.0, 0.0, 0.0), past=None)) == []
    assert names(book) == [("kT", "up", "changed")]


def test_what_does_not_stand_out_gets_no_name_yet() -> None:
    book = Book()
    book.take(crossing("kT", 10))
    assert book.take(evidence(20, 3.0, 0.0, 0.0)) == []
    assert names(book) == [("kT", "up", "changed")]
    book.take(evidence(30, 6.0, 0.0, 0.0))
    assert names(book) == [("kT", "up", "named")]


def test_causes_are_told_by_what_was_learned_since_and_sizes_by_what_is_known_now() -> None:
    book = Book()
    book.take(crossing("kT", 10))
    (e,) = book.take(replace(evidence(20, 3.0, 4.0, 0.0), since=(0.0, 9.0, 0.0)))
    assert e.parameter == "1/Ja"
    assert e.size == pytest.approx(4)


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
    (second,) = book.take(crossing("fm", 30))
    assert (second.parameter, second.stage, second.raised_us) == ("fm", "changed", 30)
    book.take(evidence(40, 10.0, 0.0, 8.0))
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
    book.take(crossing("fm", 30))
    ended, first = book.take(evidence(40, 10.0, 0.0, 1.0))
    assert (ended.parameter, ended.ended_us) == ("fm", 40)
    assert (first.parameter, first.ended_us, first.crossings) == ("kT", None, 2)
    assert names(book) == [("kT", "up", "named")]


def test_two_alarms_that_one_other_parameter_explains_become_one() -> None:
    book, _ = named(2.0, 0.0, -1.98, r=0.99)
    assert names(book) == [("kT", "up", "named")]
    book.take(crossing("fm", 30, "down"))
    changed = book.take(evidence(40, 0.0, 0.0, -4.0, r=0.99))
    assert [(e.parameter, e.ended_us) for e in changed] == [("fm", 40), ("fm", None)]
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
    (e,) = book.take(replace(crossing("kT", 25), size=11.0))
    assert (e.size, e.crossings, e.stage) == (11.0, 2, "named")
    (e,) = book.take(evidence(40, 12.0, 0.0, 0.0))
    assert e.size == pytest.approx(12)
    assert e.updated_us == 40


@pytest.mark.parametrize(
    ("held", "excess", "doubt"),
    [
        ((-1, 0, 0), 10.0, "sign"),
        ((-1, 0, 0), 0.5, "still"),
        ((1, 0, 0), 1.0, "model"),
        ((0, 0, 0), 500.0, "model"),
    ],
)
def test_sensors_are_suspected_and_raise_one_alarm_only(
    held: tuple[int, int, int], excess: float, doubt: str
) -> None:
    book = Book()
    book.take(crossing("kT", 10, "down" if held[0] < 0 else "up"))
    (e,) = book.take(evidence(20, 20.0 if held[0] >= 0 else -20.0, 3.0, 4.0, held=held, excess=excess))
    assert e.doubt == doubt
    assert book.take(crossing("fm", 30)) == []
    book.take(evidence(40, 20.0 if held[0] >= 0 else -20.0, 9.0, 9.0))
    assert book.open[0].doubt == doubt
    assert len(book.open) == 1
