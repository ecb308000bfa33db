"""The open alarms of one axis by its bank of hypotheses: what the bank says in, alarms raised, named and ended out.

What has changed beside what stands raises one alarm; its name comes with ``Named``, may be corrected once, when the
size is known well, and it ends with ``Over``.  More of a cause that stands, or less of it, is the alarm of that cause.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace

from monitor_core.detection.alarm import Alarm, Cause
from monitor_core.detection.detector_protocol import SHOWN, Book, direction_of, with_name
from monitor_core.detection.multimodel.events import Changed, Event, Named, Onset, Over
from monitor_core.detection.multimodel.hypothesis import HEALTHY
from monitor_core.detection.multimodel.naming import Share
from monitor_core.detection.multimodel.quantities import Quantity
from monitor_core.kernel.state import NEVER


class HypothesisBook(Book[Event]):
    """The open episodes of one axis; an episode is raised at the ``since_us`` of the events that it is made of.

    Args:
        quantity: of each cause.
        open_alarms: those of before.
    """

    def __init__(self, quantity: Callable[[str], Quantity], open_alarms: Iterable[Alarm] = ()) -> None:
        super().__init__(open_alarms)
        self._quantity = quantity

    def _take(self, event: Event) -> None:
        if isinstance(event, Changed):
            self._change(event)
        elif isinstance(event, Named):
            self._name(event)
        else:
            self._finish(event)

    def _change(self, event: Changed) -> None:
        share = event.shares[0]
        standing = self._of(share.cause)
        if standing is not None:
            again = replace(standing, updated_us=event.time_us, crossings=standing.crossings + 1)
            self._put(again)
        elif share.cause != HEALTHY:
            self._open.append(self._raised(event.time_us, event.onset, share))

    def _name(self, event: Named) -> None:
        share = event.shares[0]
        if share.cause == HEALTHY:  # what stood is about to end
            return
        fresh, standing = self._since(event.since_us), self._of(share.cause)
        if standing is not None and standing != fresh:
            self._open = [e for e in self._open if e != fresh]
            self._put(self._named(standing, event, standing.onset_us))
        elif fresh is not None:
            self._put(self._named(fresh, event, None))
        else:
            raised = self._raised(event.since_us, event.onset, share)
            self._open.append(replace(self._named(raised, event, None), past=()))

    def _finish(self, event: Over) -> None:
        """The cause, and, as then nothing else has changed, what was about to be named."""
        fresh = self._since(event.since_us)
        self._open = [e for e in self._open if e != fresh and e.parameter != event.cause]

    def _raised(self, since_us: int, onset: Onset, share: Share) -> Alarm:
        size, sd = self._quantity(share.cause).change(share.size, share.size_sd)
        low, best, high = _within(onset)
        return Alarm(
            parameter=share.cause,
            direction=direction_of(share.size),
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

    def _named(self, e: Alarm, event: Named, onset_us: int | None) -> Alarm:
        """With the name and the size of the event, and its onset where ``onset_us`` is None."""
        share = event.shares[0]
        size, sd = self._quantity(share.cause).change(share.size, share.size_sd)
        direction = direction_of(size)
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
            past=e.past if same else with_name(e, event.time_us),
        )
        if onset_us is not None:
            return new
        low, best, high = _within(event.onset)
        return replace(new, onset_us=best, onset_low_us=low, onset_high_us=high)

    def _of(self, cause: str) -> Alarm | None:
        """The alarm that has this name."""
        return next((e for e in self._open if e.parameter == cause and e.stage == "named"), None)

    def _since(self, since_us: int) -> Alarm | None:
        return next((e for e in self._open if e.raised_us == since_us), None)


def _within(onset: Onset) -> tuple[int | None, int, int]:
    """The onset in its interval, whose beginning is not known where it is before all that was seen."""
    low = onset.earliest_us if onset.earliest_us > NEVER // 2 else None
    best = onset.time_us if low is None else max(onset.time_us, low)
    return low, best, max(onset.latest_us, best)
