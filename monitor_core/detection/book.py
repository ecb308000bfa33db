"""The open alarms of one axis by its bank of hypotheses: what the bank says in, alarms raised, named and ended out.

What has changed beside what stands raises one alarm; its name comes with ``Named``, may be corrected once, when the
size is known well, and it ends with ``Over``.  More of a cause that stands, or less of it, is the alarm of that cause.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace

from monitor_core.alarms.book import MOST_NAMES, SHOWN
from monitor_core.alarms.episodes import Cause, Direction, Episode, Name
from monitor_core.detection.events import Changed, Event, Named, Onset, Over
from monitor_core.detection.hypotheses import HEALTHY
from monitor_core.detection.naming import Share
from monitor_core.detection.quantities import Quantity
from monitor_core.kernel.state import NEVER


class HypothesisBook:
    """The open episodes of one axis; an episode is raised at the ``since_us`` of the events that it is made of.

    Args:
        quantity: of each cause.
        open_episodes: those of before.
    """

    def __init__(self, quantity: Callable[[str], Quantity], open_episodes: Iterable[Episode] = ()) -> None:
        self._quantity = quantity
        self._open = [e for e in open_episodes if e.ended_us is None]

    @property
    def open(self) -> tuple[Episode, ...]:
        """The open episodes, the oldest first."""
        return tuple(self._open)

    def is_open(self, parameter: str) -> bool:
        """Whether the cause has an open episode."""
        return any(e.parameter == parameter for e in self._open)

    def apply(self, event: Event) -> list[Episode]:
        """Take one event; returns the episodes that it raised, changed or ended, as they are now."""
        before = list(self._open)
        if isinstance(event, Changed):
            self._change(event)
        elif isinstance(event, Named):
            self._name(event)
        else:
            self._end(event)
        now = {_identity(e) for e in self._open}
        ended = [replace(e, ended_us=event.time_us) for e in before if _identity(e) not in now]
        return ended + [e for e in self._open if e not in before]

    def _change(self, event: Changed) -> None:
        share = event.shares[0]
        standing = self._of(share.cause)
        if standing is not None:
            again = replace(standing, updated_us=event.time_us, crossings=standing.crossings + 1)
            self._put(standing, again)
        elif share.cause != HEALTHY:
            self._open.append(self._raised(event.time_us, event.onset, share))

    def _name(self, event: Named) -> None:
        share = event.shares[0]
        if share.cause == HEALTHY:  # what stood is about to end
            return
        fresh, standing = self._since(event.since_us), self._of(share.cause)
        if standing is not None and standing != fresh:
            self._open = [e for e in self._open if e != fresh]
            self._put(standing, self._named(standing, event, standing.onset_us))
        elif fresh is not None:
            self._put(fresh, self._named(fresh, event, None))
        else:
            raised = self._raised(event.since_us, event.onset, share)
            self._open.append(replace(self._named(raised, event, None), past=()))

    def _end(self, event: Over) -> None:
        """The cause, and, as then nothing else has changed, what was about to be named."""
        fresh = self._since(event.since_us)
        self._open = [e for e in self._open if e != fresh and e.parameter != event.cause]

    def _raised(self, since_us: int, onset: Onset, share: Share) -> Episode:
        size, sd = self._quantity(share.cause).change(share.size, share.size_sd)
        low, best, high = _within(onset)
        return Episode(
            parameter=share.cause,
            direction=_direction(share.size),
            onset_us=best,
            raised_us=since_us,
            updated_us=since_us,
            ended_us=None,
            size=size,
            size_sd=sd,
            crossings=1,
            onset_low_us=low,
            onset_high_us=high,
        )

    def _named(self, e: Episode, event: Named, onset_us: int | None) -> Episode:
        """With the name and the size of the event, and its onset where ``onset_us`` is None."""
        share = event.shares[0]
        size, sd = self._quantity(share.cause).change(share.size, share.size_sd)
        direction = _direction(size)
        same = (e.stage, e.parameter, e.direction) == ("named", share.cause, direction)
        new = replace(
            e,
            parameter=share.cause,
            direction=direction,
            stage="named",
            updated_us=event.time_us,
            size=size,
            size_sd=sd,
            causes=tuple(
                Cause(s.cause, s.probability, s.alike)
                for s in event.shares
                if s.probability >= SHOWN and s.cause
            ),
            past=e.past if same else _with_name(e, event.time_us),
        )
        if onset_us is not None:
            return new
        low, best, high = _within(event.onset)
        return replace(new, onset_us=best, onset_low_us=low, onset_high_us=high)

    def _of(self, cause: str) -> Episode | None:
        """The alarm that has this name."""
        return next((e for e in self._open if e.parameter == cause and e.stage == "named"), None)

    def _since(self, since_us: int) -> Episode | None:
        return next((e for e in self._open if e.raised_us == since_us), None)

    def _put(self, old: Episode, new: Episode) -> None:
        self._open = [new if e == old else e for e in self._open]


def _identity(e: Episode) -> tuple[int, str, Direction]:
    return e.raised_us, *e.first


def _with_name(e: Episode, until_us: int) -> tuple[Name, ...]:
    names = (*e.past, Name(until_us, e.stage, e.parameter, e.direction))
    return names if len(names) <= MOST_NAMES else (names[0], *names[2 - MOST_NAMES :])


def _direction(size: float) -> Direction:
    """Up where there is no size."""
    return "down" if size < 0 else "up"


def _within(onset: Onset) -> tuple[int | None, int, int]:
    """The onset in its interval, whose beginning is not known where it is before all that was seen."""
    low = onset.earliest_us if onset.earliest_us > NEVER // 2 else None
    best = onset.time_us if low is None else max(onset.time_us, low)
    return low, best, max(onset.latest_us, best)
