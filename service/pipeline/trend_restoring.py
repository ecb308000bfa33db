"""The slow histories as the last run left them."""

from service.pipeline.restore_report import HISTORY, Loss
from service.pipeline.trend_tracking import Trends
from service.store.array_files import Arrays
from service.store.checkpoints import Checkpoints, QuarantinedCheckpoint


def restore_trends(trends: Trends, checkpoints: Checkpoints, now_us: int) -> list[Loss]:
    """Put the slow histories back; returns those that are of no use.

    One that is damaged, or was made with other nominal values, is quarantined, counted, and begins anew.

    Raises:
        StoreError: the file cannot be read or written.
    """
    found: dict[str, Arrays] = {}
    losses = []
    parts = list(trends.to_load())
    for axis_id, part in parts:
        loaded = checkpoints.load(part.name, part.key, now_us)
        if isinstance(loaded, QuarantinedCheckpoint):
            trends.lost[axis_id] += 1
            losses.append(Loss(axis_id, HISTORY, loaded.reason, part.parameter))
        elif loaded is not None:
            found[part.name] = loaded.arrays
    of = {part.name: (axis_id, part.parameter) for axis_id, part in parts}
    for name, reason in trends.restore(found):
        checkpoints.quarantine(name, reason, now_us)
        axis_id, parameter = of[name]
        losses.append(Loss(axis_id, HISTORY, reason, parameter))
    return losses
