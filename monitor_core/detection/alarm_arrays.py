"""Open episodes as an array and back, for checkpoints."""

import json
from collections.abc import Collection, Iterable
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monitor_core.detection.alarm import Alarm, Cause, Name, Reach


def episodes_to_array(episodes: Iterable[Alarm]) -> NDArray[np.generic]:
    """The bytes of a JSON text (N,)."""
    text = json.dumps([asdict(e) for e in episodes])
    return np.frombuffer(text.encode(), np.uint8)


def episodes_from_array(array: NDArray[np.generic], causes: Collection[str]) -> list[Alarm]:
    """What ``episodes_to_array`` made, of these causes.

    Raises:
        ValueError: these are no episodes, or episodes of something that is not monitored.
    """
    try:
        episodes = [_episode(fields) for fields in json.loads(np.asarray(array, np.uint8).tobytes())]
    except (TypeError, KeyError, ValueError) as error:
        raise ValueError(f"no episodes: {error}") from error
    for e in episodes:
        if e.parameter not in causes:
            raise ValueError(f"an episode of {e.parameter}, which is not monitored")
    return episodes


def _episode(fields: dict[str, Any]) -> Alarm:
    causes = tuple(Cause.read(cause) for cause in fields.pop("causes"))
    past = tuple(Name(*name) for name in fields.pop("past"))
    reaches = tuple(Reach(*reach) for reach in fields.pop("reaches", ()))
    return Alarm(**fields, causes=causes, past=past, reaches=reaches)
