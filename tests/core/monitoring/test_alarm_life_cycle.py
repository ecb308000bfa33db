"""The life cycle of an alarm against the diagram of ISA-18.2: what is legal, what is not, and replay of the journal."""

from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from monitor_core.monitoring import (
    ACTIVE_STATES,
    HIDDEN_STATES,
    MAX_SHELF_S,
    AlarmEvent,
    AlarmLife,
    AlarmRules,
    AlarmState,
    AlarmTransitionError,
    ShelfEndError,
    Transition,
    check_shelf,
    due,
    is_present,
    returns_us,
    transition,
)
from tests.core.alarm_lives import replayed

S, E = AlarmState, AlarmEvent
PERSON = (E.ACKNOWLEDGE, E.SHELVE, E.UNSHELVE, E.COMMENT)

ARROWS = """
normal raise unacknowledged
returned raise unacknowledged
latched raise unacknowledged
unacknowledged clear returned
acknowledged clear normal
unacknowledged latch latched
acknowledged latch latched
unacknowledged acknowledge acknowledged
returned acknowledge normal
latched acknowledge normal
"""
"""The arrows between shown states, transcribed from the diagram of the standard."""


def test_the_arrows_between_shown_states_are_those_of_the_standard() -> None:
    drawn = {tuple(line.split()) for line in ARROWS.split("\n") if line}
    found = set()
    for before in set(S) - set(HIDDEN_STATES):
        for event in (E.RAISE, E.CLEAR, E.LATCH, E.ACKNOWLEDGE):
            try:
                found.add((before, event, transition(AlarmLife(before), event).after.state))
            except AlarmTransitionError:
                continue
    assert found == drawn


@pytest.mark.parametrize("below", sorted(set(S) - set(HIDDEN_STATES)))
def test_what_hides_an_alarm_gives_it_back_as_it_was(below: AlarmState) -> None:
    life = AlarmLife(below)
    pairs = [
        (E.SHELVE, E.UNSHELVE),
        (E.SHELVE, E.SHELF_ENDED),
        (E.SUPPRESS, E.UNSUPPRESS),
        (E.REMOVE, E.RETURN),
    ]
    for hide, show in pairs:
        hidden = transition(life, hide, 5 if hide is E.SHELVE else None).after
        assert (hidden.hidden, hidden.below, hidden.active) == (True, below, life.active)
        assert transition(hidden, show).after == life
    assert transition(AlarmLife(S.SHELVED, below, 5), E.REMOVE).after == AlarmLife(S.OUT_OF_SERVICE, below)


def test_a_hidden_alarm_follows_its_cause_and_is_not_acknowledged() -> None:
    shelved = AlarmLife(S.SHELVED, S.UNACKNOWLEDGED, 10)
    gone = transition(shelved, E.CLEAR).after
    assert gone == AlarmLife(S.SHELVED, S.NORMAL, 10)
    assert transition(gone, E.RAISE).after == shelved
    with pytest.raises(AlarmTransitionError, match="acknowledge; the alarm is shelved: unshelve it first"):
        transition(shelved, E.ACKNOWLEDGE)
    with pytest.raises(AlarmTransitionError, match="shelve; the alarm is suppressed: the configuration"):
        transition(AlarmLife(S.SUPPRESSED, S.NORMAL), E.SHELVE, 10)


def test_the_end_of_a_shelf_shows_the_alarm_by_the_clock_alone() -> None:
    shelved = AlarmLife(S.SHELVED, S.ACKNOWLEDGED, 1_000_000)
    assert shelved.at(999_999) == shelved
    assert shelved.at(1_000_000) == AlarmLife(S.ACKNOWLEDGED)
    check_shelf(2, 1)
    for until_us in (1, 0):
        with pytest.raises(ShelfEndError, match="in the future"):
            check_shelf(until_us, 1)
    longest_us = round(MAX_SHELF_S * 1e6)
    check_shelf(1 + longest_us, 1)
    with pytest.raises(ShelfEndError, match="at most 7 days"):
        check_shelf(2 + longest_us, 1)


@pytest.mark.parametrize(
    ("rules", "events"),
    [
        (AlarmRules(), ["raise", "clear"]),
        (AlarmRules(latched=True), ["raise", "latch"]),
        (AlarmRules(suppressed=True), ["suppress", "raise", "clear", "unsuppress"]),
        (AlarmRules(latched=True, out_of_service=True, suppressed=True),
         ["remove from service", "raise", "clear", "return to service"]),
    ],
)  # fmt: skip
def test_the_configuration_hides_an_alarm_before_it_is_raised(rules: AlarmRules, events: list[str]) -> None:
    raised = due(AlarmLife(), True, rules)
    gone = due(raised[-1].after, False, rules)
    assert [t.event for t in (*raised, *gone)] == events
    hidden = rules.suppressed or rules.out_of_service
    shown = {t.after.state for t in (*raised, *gone) if not t.after.hidden}
    assert shown == ({S.NORMAL} if hidden else {S.UNACKNOWLEDGED, gone[-1].after.state})


def test_a_cause_that_comes_and_goes_within_the_off_delay_is_one_alarm() -> None:
    """Each second is looked at: away from 1 s to 3 s, from 4 s to 8 s, and from 9 s on; a person knows from 2 s on."""
    rules, life, found = AlarmRules(off_delay_s=5), AlarmLife(), []
    for second in range(20):
        ended = next((s for s, back in ((1, 3), (4, 8), (9, 99)) if s <= second < back), None)
        now_us, ended_us = second * 1_000_000, None if ended is None else ended * 1_000_000
        changes = due(life, is_present(life, ended_us, now_us, rules), rules)
        changes += [transition(life, E.ACKNOWLEDGE)] if second == 2 else []
        found += [(second, str(change.event)) for change in changes]
        life = changes[-1].after if changes else life
    assert found == [(0, "raise"), (2, "acknowledge"), (14, "clear")]


def test_a_longer_off_delay_brings_no_alarm_back_that_has_returned() -> None:
    for state in (S.NORMAL, S.RETURNED, S.LATCHED):
        assert not is_present(AlarmLife(state), 7, 8, AlarmRules(off_delay_s=60))
    assert returns_us(AlarmLife(S.SHELVED, S.ACKNOWLEDGED, 99), 7, AlarmRules(off_delay_s=60)) == 60_000_007
    assert returns_us(AlarmLife(S.ACKNOWLEDGED), None, AlarmRules(off_delay_s=60)) is None


class Life(RuleBasedStateMachine):
    """Any cause, any person, any configuration, in any order."""

    def __init__(self) -> None:
        super().__init__()
        self.now_us, self.life, self.handled = 0, AlarmLife(), AlarmRules()
        self.ended_us: int | None = 0
        self.journal: list[Transition] = []

    def take(self, change: Transition) -> None:
        assert change.before == self.life
        self.journal.append(change)
        self.life = change.after

    @property
    def present(self) -> bool:
        return is_present(self.life, self.ended_us, self.now_us, self.handled)

    def settle(self) -> None:
        for change in due(self.life, self.present, self.handled):
            self.take(change)
        hidden = (self.handled.suppressed or self.handled.out_of_service) and self.life.active
        assert (self.life.state in (S.SUPPRESSED, S.OUT_OF_SERVICE)) == hidden
        assert due(self.life, self.present, self.handled) == []

    @rule(rules=st.builds(AlarmRules, latched=st.booleans(), suppressed=st.booleans(), out_of_service=st.booleans(),
                          off_delay_s=st.sampled_from([0.0, 2.0, 6.0])))  # fmt: skip
    def configuration(self, rules: AlarmRules) -> None:
        self.handled = rules
        self.settle()

    @rule(there=st.booleans())
    def cause(self, there: bool) -> None:
        back = there and self.present and self.ended_us is not None
        before = self.life
        if there:
            self.ended_us = None
        elif self.ended_us is None:
            self.ended_us = self.now_us
        self.settle()
        assert not back or self.life == before

    @rule(event=st.sampled_from(PERSON), seconds=st.integers(1, 10))
    def person(self, event: AlarmEvent, seconds: int) -> None:
        until_us = self.now_us + seconds * 1_000_000 if event is E.SHELVE else None
        try:
            self.take(transition(self.life, event, until_us))
        except AlarmTransitionError as error:
            assert f"the alarm is {self.life.state}: " in str(error)  # noqa: PT017

    @rule(seconds=st.integers(1, 5))
    def clock(self, seconds: int) -> None:
        self.now_us += seconds * 1_000_000
        self.settle()
        shown = self.life.at(self.now_us)
        if shown != self.life:
            self.take(transition(self.life, E.SHELF_ENDED))
            assert self.life == shown

    @invariant()
    def state_is_legal(self) -> None:
        life = self.life
        assert life.hidden == (life.returns_to is not None)
        assert life.below not in HIDDEN_STATES
        assert (life.until_us is not None) == (life.state is S.SHELVED)
        assert life.until_us is None or life.until_us > self.now_us
        assert (life.below in (S.UNACKNOWLEDGED, S.ACKNOWLEDGED)) == self.present
        assert life.active == (life.below in ACTIVE_STATES)

    @invariant()
    def journal_gives_the_same_state(self) -> None:
        assert replayed((t.event, t.after.until_us) for t in self.journal) == self.life


TestLife: Any = Life.TestCase
TestLife.settings = settings(
    max_examples=40, stateful_step_count=30, deadline=None, suppress_health_check=list(HealthCheck)
)
