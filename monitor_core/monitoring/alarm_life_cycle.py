"""Life cycle of an alarm (the state model of ISA-18.2 and IEC 62682).

A detector decides whether the cause of an alarm is present.  The life cycle adds whether a person has acknowledged the
alarm, and whether it is shown.  An alarm that is shelved, suppressed by design or out of service is hidden; its cause
is still followed, so that the alarm reappears in its then present state.

An alarm returns to normal when its cause has been absent for the off-delay.  If the cause comes back sooner, it counts
as present all the time: the alarm keeps its state and need not be acknowledged again.

The letters are those of the standards' diagram.  Transitions that are not in ``_SHOWN``, ``_HIDDEN``, ``_OVERLAYS`` or
``_UNCOVERS`` are illegal.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Literal, NamedTuple

from monitor_core.wording import sentence

Priority = Literal["low", "medium", "high"]
PRIORITIES: tuple[Priority, ...] = ("low", "medium", "high")

MAX_SHELF_S = 7 * 86400.0
"""Longest time for which an alarm may be shelved [s]: until the next planned maintenance, not until it is forgotten."""
_MAX_CLOCK_STEP_S = 3600.0
"""The clock may be set back by this time [s] while an alarm is shelved."""


class AlarmState(StrEnum):
    """States of an alarm."""

    NORMAL = "normal"
    """A: the cause is absent, and nothing has to be acknowledged"""
    UNACKNOWLEDGED = "unacknowledged"
    """B: the cause is present, nobody has acknowledged the alarm"""
    ACKNOWLEDGED = "acknowledged"
    """C: the cause is present, a person has acknowledged the alarm"""
    RETURNED = "returned"
    """D: the cause is absent, nobody has acknowledged the alarm ("RTN unacknowledged")"""
    LATCHED = "latched"
    """E: the cause is absent; the alarm stays active until it is acknowledged (again)"""
    SHELVED = "shelved"
    """G: hidden by a person until a time"""
    SUPPRESSED = "suppressed"
    """H: hidden by the configuration ("suppressed by design")"""
    OUT_OF_SERVICE = "out-of-service"
    """I: hidden while its axis is maintained, by a person or by the configuration"""


HIDDEN_STATES = (AlarmState.SHELVED, AlarmState.SUPPRESSED, AlarmState.OUT_OF_SERVICE)
ACTIVE_STATES = (AlarmState.UNACKNOWLEDGED, AlarmState.ACKNOWLEDGED, AlarmState.LATCHED)


class AlarmEvent(StrEnum):
    """Events in the life of an alarm.  All but COMMENT and NAME change its state."""

    RAISE = "raise"
    CLEAR = "clear"
    LATCH = "latch"
    """The cause of a latched alarm is absent"""
    ACKNOWLEDGE = "acknowledge"
    SHELVE = "shelve"
    UNSHELVE = "unshelve"
    SHELF_ENDED = "shelf ended"
    SUPPRESS = "suppress"
    UNSUPPRESS = "unsuppress"
    REMOVE = "remove from service"
    RETURN = "return to service"
    COMMENT = "comment"
    NAME = "name"
    """The cause has been identified, or corrected; the state stays the same"""


class AlarmTransitionError(ValueError):
    """The event is not possible in the present state; the text says why, and what is possible."""


class ShelfEndError(ValueError):
    """An alarm cannot be shelved until that time."""


_S, _E = AlarmState, AlarmEvent
_Transitions = Mapping[tuple[AlarmState, AlarmEvent], AlarmState]

_SHOWN: _Transitions = {
    (_S.NORMAL, _E.RAISE): _S.UNACKNOWLEDGED,
    (_S.RETURNED, _E.RAISE): _S.UNACKNOWLEDGED,
    (_S.LATCHED, _E.RAISE): _S.UNACKNOWLEDGED,
    (_S.UNACKNOWLEDGED, _E.CLEAR): _S.RETURNED,
    (_S.ACKNOWLEDGED, _E.CLEAR): _S.NORMAL,
    (_S.UNACKNOWLEDGED, _E.LATCH): _S.LATCHED,
    (_S.ACKNOWLEDGED, _E.LATCH): _S.LATCHED,
    (_S.UNACKNOWLEDGED, _E.ACKNOWLEDGE): _S.ACKNOWLEDGED,
    (_S.RETURNED, _E.ACKNOWLEDGE): _S.NORMAL,
    (_S.LATCHED, _E.ACKNOWLEDGE): _S.NORMAL,
}
_HIDDEN: _Transitions = {
    **{(state, event): to for (state, event), to in _SHOWN.items() if event in (_E.RAISE, _E.LATCH)},
    # A cause that came and went while the alarm was hidden need not be acknowledged.
    (_S.UNACKNOWLEDGED, _E.CLEAR): _S.NORMAL,
    (_S.ACKNOWLEDGED, _E.CLEAR): _S.NORMAL,
}
"""Transitions of the state below a hidden one, to which the alarm returns."""
_OVERLAYS: Mapping[AlarmEvent, tuple[AlarmState, tuple[AlarmState, ...]]] = {
    _E.SHELVE: (_S.SHELVED, ()),
    _E.SUPPRESS: (_S.SUPPRESSED, (_S.SHELVED, _S.OUT_OF_SERVICE)),
    _E.REMOVE: (_S.OUT_OF_SERVICE, (_S.SHELVED, _S.SUPPRESSED)),
}
"""By event: the state that hides the alarm, and the hidden states that it may replace."""
_UNCOVERS = {
    _E.UNSHELVE: _S.SHELVED,
    _E.SHELF_ENDED: _S.SHELVED,
    _E.UNSUPPRESS: _S.SUPPRESSED,
    _E.RETURN: _S.OUT_OF_SERVICE,
}
_ADVICE: Mapping[AlarmState, str] = {
    _S.NORMAL: "it has ended and needs nothing more; a comment is possible",
    _S.UNACKNOWLEDGED: "it can be acknowledged or shelved",
    _S.ACKNOWLEDGED: "it can be shelved; a comment is possible",
    _S.RETURNED: "its cause is gone; it can be acknowledged",
    _S.LATCHED: "its cause is gone; it stays active until it is acknowledged",
    _S.SHELVED: "unshelve it first",
    _S.SUPPRESSED: "the configuration suppresses it, in [robot.axis.alarms]",
    _S.OUT_OF_SERVICE: "its axis is out of service",
}


class AlarmLife(NamedTuple):
    """The state of an alarm.

    ``returns_to``: the state below a hidden one; otherwise None.  ``until_us``: end of a shelf [us]; otherwise None.
    """

    state: AlarmState = AlarmState.NORMAL
    returns_to: AlarmState | None = None
    until_us: int | None = None

    @property
    def below(self) -> AlarmState:
        """The state apart from hiding: ``returns_to`` of a hidden alarm."""
        return self.state if self.returns_to is None else self.returns_to

    @property
    def active(self) -> bool:
        """Whether the cause is present, or the alarm is latched."""
        return self.below in ACTIVE_STATES

    @property
    def hidden(self) -> bool:
        """Whether the alarm is shelved, suppressed or out of service."""
        return self.state in HIDDEN_STATES

    def at(self, now_us: int) -> AlarmLife:
        """The state at a time.  A shelf that has ended no longer hides the alarm, even before its end is recorded.

        A shelf that would last too long from now has ended too: the clock was ahead when the alarm was shelved.
        """
        longest_us = (MAX_SHELF_S + _MAX_CLOCK_STEP_S) * 1e6
        over = self.until_us is not None and not 0 < self.until_us - now_us <= longest_us
        return AlarmLife(self.below) if over else self


class Transition(NamedTuple):
    """An event and the states before and after it, which are equal for a comment and a name."""

    event: AlarmEvent
    before: AlarmLife
    after: AlarmLife


class AlarmRules(NamedTuple):
    """How the alarms of a parameter are handled.

    ``off_delay_s``: time for which the cause must be absent before the alarm returns to normal.
    """

    priority: Priority = "medium"
    latched: bool = False
    suppressed: bool = False
    out_of_service: bool = False
    off_delay_s: float = 0.0


def transition(life: AlarmLife, event: AlarmEvent, until_us: int | None = None) -> Transition:
    """The transition of an alarm by an event.

    Args:
        life: state before the event.
        event: the event.
        until_us: end of the shelf [us], for the event SHELVE.

    Raises:
        AlarmTransitionError: the event is not possible now.
    """
    return Transition(event, life, _after(life, event, until_us))


def _after(life: AlarmLife, event: AlarmEvent, until_us: int | None) -> AlarmLife:
    state = life.state
    if event in (AlarmEvent.COMMENT, AlarmEvent.NAME):
        return life
    if event in _OVERLAYS:
        hides, replaces = _OVERLAYS[event]
        if not life.hidden or state in replaces:
            return AlarmLife(hides, life.below, until_us if event is AlarmEvent.SHELVE else None)
    elif event in _UNCOVERS:
        if state is _UNCOVERS[event]:
            return AlarmLife(life.below)
    elif life.hidden:
        if (life.below, event) in _HIDDEN:
            return life._replace(returns_to=_HIDDEN[life.below, event])
    elif (state, event) in _SHOWN:
        return AlarmLife(_SHOWN[state, event])
    words = "not possible: {event}; the alarm is {state}: {advice}"
    raise AlarmTransitionError(sentence("not possible", words, event=event, state=state, advice=_ADVICE[state]))


def check_shelf(until_us: int, now_us: int) -> None:
    """Check the end of a shelf.

    Raises:
        ShelfEndError: it is not in the future, or too far in it.
    """
    remaining_s = (until_us - now_us) / 1e6
    if remaining_s <= 0:
        raise ShelfEndError("an alarm can be shelved only until a time in the future")
    if remaining_s > MAX_SHELF_S:
        days = MAX_SHELF_S / 86400
        raise ShelfEndError(
            f"an alarm can be shelved for at most {days:.0f} days; to hide it for longer, suppress it in "
            "[robot.axis.alarms] of the configuration"
        )


def due(life: AlarmLife, present: bool, rules: AlarmRules) -> list[Transition]:
    """The transitions that bring an alarm into agreement with its cause and with the configuration.

    An alarm that the configuration hides is never shown: it is hidden before it is raised, and it is cleared without
    latching when its cause is gone.

    Args:
        life: the present state.
        present: whether the cause is present now.
        rules: rules of its parameter.
    """
    transitions: list[Transition] = []

    def add(event: AlarmEvent) -> None:
        transitions.append(transition(transitions[-1].after if transitions else life, event))

    by_rule = life.state in _BY_RULE
    if not present and life.below in _PRESENT:
        add(AlarmEvent.LATCH if rules.latched and not by_rule else AlarmEvent.CLEAR)
    now = transitions[-1].after if transitions else life
    required = _required_hidden(rules) if present or now.active else None
    if now.state is not required:
        if required is not None:
            add(_OVERLAY_EVENTS[required])
        elif by_rule:
            add(_UNCOVERED_BY[now.state])
    if present and life.below not in _PRESENT:
        add(AlarmEvent.RAISE)
    return transitions


def returns_us(life: AlarmLife, ended_us: int | None, rules: AlarmRules) -> int | None:
    """End of the off-delay of an alarm [us], if its cause stays absent; None: no off-delay runs.

    Args:
        life: the present state.
        ended_us: time since which the cause is absent [us]; None: it is present.
        rules: rules of its parameter.
    """
    if ended_us is None or life.below not in _PRESENT:
        return None
    return ended_us + round(1e6 * rules.off_delay_s)


def is_present(life: AlarmLife, ended_us: int | None, at_us: int, rules: AlarmRules) -> bool:
    """Whether the cause counts as present: it is, or the off-delay still runs; arguments as in ``returns_us``."""
    over_us = returns_us(life, ended_us, rules)
    return ended_us is None or (over_us is not None and at_us < over_us)


_PRESENT = (AlarmState.UNACKNOWLEDGED, AlarmState.ACKNOWLEDGED)
_BY_RULE = (AlarmState.SUPPRESSED, AlarmState.OUT_OF_SERVICE)
_OVERLAY_EVENTS = {hides: event for event, (hides, _) in _OVERLAYS.items()}
_UNCOVERED_BY = {state: event for event, state in _UNCOVERS.items() if event is not AlarmEvent.SHELF_ENDED}


def _required_hidden(rules: AlarmRules) -> AlarmState | None:
    """The hidden state that the configuration requires for an alarm; None: it does not hide the alarm."""
    if rules.out_of_service:
        return AlarmState.OUT_OF_SERVICE
    return AlarmState.SUPPRESSED if rules.suppressed else None
