"""Life cycle of an alarm: what an operator has done about it (ISA-18.2 and IEC 62682, the state model of alarms).

A detector says whether the cause of an alarm is there.  This is the other half: whether a person has seen the alarm,
and whether it is to be shown.  An alarm that is shelved, suppressed by design or out of service is hidden; its cause is
still followed, so that it comes back as it is by then.

An alarm returns when its cause has been away for the off-delay.  A cause that is back sooner was there all the time:
its alarm stays as it is, and who has acknowledged it is not asked again.

The letters are those of the standards' diagram.  What is not in ``_SHOWN``, ``_HIDDEN`` or ``_OVERLAYS`` is illegal.
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
_SET_S = 3600.0
"""The clock may be set back by this much meanwhile [s]"""


class AlarmState(StrEnum):
    """States of an alarm."""

    NORMAL = "normal"
    """A: the cause is gone, and the alarm needs no person"""
    UNACKNOWLEDGED = "unacknowledged"
    """B: the cause is there, nobody has acknowledged it"""
    ACKNOWLEDGED = "acknowledged"
    """C: the cause is there, a person knows"""
    RETURNED = "returned"
    """D: the cause is gone, nobody has acknowledged it ("RTN unacknowledged")"""
    LATCHED = "latched"
    """E: the cause is gone; the alarm stays active until it is acknowledged, also if it was before"""
    SHELVED = "shelved"
    """G: hidden by a person until a time"""
    SUPPRESSED = "suppressed"
    """H: hidden by the configuration ("suppressed by design")"""
    OUT_OF_SERVICE = "out-of-service"
    """I: hidden while its axis is maintained, by a person or by the configuration"""


HIDDEN_STATES = (AlarmState.SHELVED, AlarmState.SUPPRESSED, AlarmState.OUT_OF_SERVICE)
ACTIVE_STATES = (AlarmState.UNACKNOWLEDGED, AlarmState.ACKNOWLEDGED, AlarmState.LATCHED)


class AlarmEvent(StrEnum):
    """Events that change the state of an alarm, except that a comment and a name change none."""

    RAISE = "raise"
    CLEAR = "clear"
    LATCH = "latch"
    """The cause of a latched alarm is gone"""
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
    """The cause has been found, or corrected; the state stays"""


class AlarmTransitionError(ValueError):
    """The event is not possible in the present state; the text says why, and what would be right."""


class ShelfEndError(ValueError):
    """An alarm cannot be shelved until that time."""


_S, _E = AlarmState, AlarmEvent
_Steps = Mapping[tuple[AlarmState, AlarmEvent], AlarmState]

_SHOWN: _Steps = {
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
_HIDDEN: _Steps = {
    **{(state, event): to for (state, event), to in _SHOWN.items() if event in (_E.RAISE, _E.LATCH)},
    # What came and went while it was hidden needs no person.
    (_S.UNACKNOWLEDGED, _E.CLEAR): _S.NORMAL,
    (_S.ACKNOWLEDGED, _E.CLEAR): _S.NORMAL,
}
"""What becomes of the state to which a hidden alarm returns."""
_OVERLAYS: Mapping[AlarmEvent, tuple[AlarmState, tuple[AlarmState, ...]]] = {
    _E.SHELVE: (_S.SHELVED, ()),
    _E.SUPPRESS: (_S.SUPPRESSED, (_S.SHELVED, _S.OUT_OF_SERVICE)),
    _E.REMOVE: (_S.OUT_OF_SERVICE, (_S.SHELVED, _S.SUPPRESSED)),
}
"""The state that hides the alarm, and the hidden states which it may replace."""
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
    """The state of an alarm.  ``returns_to``: of a hidden one, the state below; ``until_us``: of a shelved one."""

    state: AlarmState = AlarmState.NORMAL
    returns_to: AlarmState | None = None
    until_us: int | None = None

    @property
    def below(self) -> AlarmState:
        """The state without what hides it."""
        return self.state if self.returns_to is None else self.returns_to

    @property
    def active(self) -> bool:
        """Whether its cause is there, or it is latched."""
        return self.below in ACTIVE_STATES

    @property
    def hidden(self) -> bool:
        """Whether it is shelved, suppressed or out of service."""
        return self.state in HIDDEN_STATES

    def at(self, now_us: int) -> AlarmLife:
        """The state at a time: a shelf that is over hides nothing, even before its end is recorded.

        Nor does one that would last too long from now: the clock was ahead when the alarm was shelved.
        """
        over = self.until_us is not None and not 0 < self.until_us - now_us <= (MAX_SHELF_S + _SET_S) * 1e6
        return AlarmLife(self.below) if over else self


class Transition(NamedTuple):
    """A change of the state of an alarm.  ``before`` and ``after`` are equal for a comment and a name."""

    event: AlarmEvent
    before: AlarmLife
    after: AlarmLife


class AlarmRules(NamedTuple):
    """How the alarms of a parameter are handled.  ``off_delay_s``: for how long its cause is away before it returns."""

    priority: Priority = "medium"
    latched: bool = False
    suppressed: bool = False
    out_of_service: bool = False
    off_delay_s: float = 0.0


def transition(life: AlarmLife, event: AlarmEvent, until_us: int | None = None) -> Transition:
    """What an event makes of an alarm.

    Args:
        life: before the event.
        event: what has happened.
        until_us: end of the shelf, of the event SHELVE.

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
    raise AlarmTransitionError(
        sentence("not possible", words, event=event, state=state, advice=_ADVICE[state])
    )


def check_shelf(until_us: int, now_us: int) -> None:
    """Check the end of a shelf.

    Raises:
        ShelfEndError: it is not in the future, or too far in it.
    """
    left_s = (until_us - now_us) / 1e6
    if left_s <= 0:
        raise ShelfEndError("an alarm can be shelved only until a time in the future")
    if left_s > MAX_SHELF_S:
        days = MAX_SHELF_S / 86400
        raise ShelfEndError(
            f"an alarm can be shelved for at most {days:.0f} days; what has to stay hidden for longer belongs into "
            "[robot.axis.alarms] of the configuration"
        )


def due(life: AlarmLife, present: bool, rules: AlarmRules) -> list[Transition]:
    """The transitions after which an alarm agrees with its cause and with the configuration.

    What the configuration hides was never shown: it is hidden before it is raised, and over when its cause is gone.

    Args:
        life: the alarm so far.
        present: whether the cause is there now.
        rules: of its parameter.
    """
    found: list[Transition] = []

    def then(event: AlarmEvent) -> None:
        found.append(transition(found[-1].after if found else life, event))

    by_rule = life.state in _BY_RULE
    if not present and life.below in _PRESENT:
        then(AlarmEvent.LATCH if rules.latched and not by_rule else AlarmEvent.CLEAR)
    now = found[-1].after if found else life
    wanted = _wanted(rules) if present or now.active else None
    if now.state is not wanted:
        if wanted is not None:
            then(_OVERLAY_EVENTS[wanted])
        elif by_rule:
            then(_UNCOVERED_BY[now.state])
    if present and life.below not in _PRESENT:
        then(AlarmEvent.RAISE)
    return found


def returns_us(life: AlarmLife, ended_us: int | None, rules: AlarmRules) -> int | None:
    """When the off-delay of an alarm is over, if its cause stays away; None: it does not wait for that.

    Args:
        life: the alarm so far.
        ended_us: since when its cause is away; None: it is there.
        rules: of its parameter.
    """
    if ended_us is None or life.below not in _PRESENT:
        return None
    return ended_us + round(1e6 * rules.off_delay_s)


def is_present(life: AlarmLife, ended_us: int | None, at_us: int, rules: AlarmRules) -> bool:
    """Whether the cause of an alarm counts as there: it is, or the off-delay is not over; arguments as before."""
    over_us = returns_us(life, ended_us, rules)
    return ended_us is None or (over_us is not None and at_us < over_us)


_PRESENT = (AlarmState.UNACKNOWLEDGED, AlarmState.ACKNOWLEDGED)
_BY_RULE = (AlarmState.SUPPRESSED, AlarmState.OUT_OF_SERVICE)
_OVERLAY_EVENTS = {hides: event for event, (hides, _) in _OVERLAYS.items()}
_UNCOVERED_BY = {state: event for event, state in _UNCOVERS.items() if event is not AlarmEvent.SHELF_ENDED}


def _wanted(rules: AlarmRules) -> AlarmState | None:
    """The state in which the configuration hides an alarm; None: it does not."""
    if rules.out_of_service:
        return AlarmState.OUT_OF_SERVICE
    return AlarmState.SUPPRESSED if rules.suppressed else None
