"""What of the last run's state could not be used: one message for each axis, of all that it has lost."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

ESTIMATES, BANK, HISTORY = "the estimates", "the evidence of the bank of hypotheses", "the slow history"
_IN_ORDER = (ESTIMATES, BANK, HISTORY)


class Loss(NamedTuple):
    """A saved state that was quarantined, as it cannot be used."""

    axis_id: str
    what: str
    """ESTIMATES, BANK or HISTORY"""
    reason: str
    of: str = ""
    """Of a history: the parameter; empty: what was being gathered, of all of them"""


def losses_in_words(losses: Iterable[Loss]) -> Iterator[str]:
    """A sentence for each axis: why its checkpoint is not used, and what restarts."""
    by_axis: dict[str, list[Loss]] = {}
    for loss in losses:
        by_axis.setdefault(loss.axis_id, []).append(loss)
    for axis_id, own in by_axis.items():
        part = "" if ESTIMATES in {loss.what for loss in own} else "part of "
        reasons = dict.fromkeys(loss.reason for loss in own)
        said = (
            f"{why}; what restarts: {_what(loss for loss in own if loss.reason == why)}" for why in reasons
        )
        yield f"{axis_id}: {part}its checkpoint is not used and quarantined: {'. Also: '.join(said)}"


def _what(losses: Iterable[Loss]) -> str:
    """The estimates, the evidence of .. and the slow history of kT and fm."""
    found: dict[str, dict[str, None]] = {}
    for loss in sorted(losses, key=lambda loss: _IN_ORDER.index(loss.what)):
        found.setdefault(loss.what, {}).update({loss.of: None} if loss.of else {})
    return _listed([f"{what} of {_listed(list(of))}" if of else what for what, of in found.items()])


def _listed(names: list[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)
