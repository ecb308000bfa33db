"""The slow histories as the last run left them."""

from service.monitoring.trends import Trends
from service.store.arrays import Arrays
from service.store.checkpoints import Checkpoints, SetAside


def restore_trends(trends: Trends, checkpoints: Checkpoints, now_us: int) -> list[str]:
    """Put the slow histories back; returns what the operator has to be told.

    One that is damaged, or was made with other nominal values, is kept aside, counted, and begins anew.

    Raises:
        StoreError: the file cannot be read or written.
    """
    found: dict[str, Arrays] = {}
    messages = []
    for axis_id, part in trends.to_load():
        loaded = checkpoints.load(part.name, part.key, now_us)
        if isinstance(loaded, SetAside):
            trends.lost[axis_id] += 1
            messages.append(loaded.message)
        elif loaded is not None:
            found[part.name] = loaded.arrays
    for name, reason in trends.restore(found):
        checkpoints.set_aside(name, reason, now_us)
        messages.append(SetAside(name, now_us, reason).message)
    return messages
