"""Times as people write them: 10min, 1h, "14 days"."""

import re

UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0, "y": 31557600.0}
_TIME = re.compile(r"(?P<number>[\d.]+)\s*(?P<unit>[a-z]*)")
_SPELLED = {"hour": "h", "day": "d", "week": "w", "year": "y", "minute": "min", "second": "s", "m": "min"}
_ALL = UNITS | {"w": 7 * UNITS["d"]}
LONGEST_S = 1000 * UNITS["y"]


def seconds_in(text: str) -> float:
    """A time such as 10min, 1h, 30d, 1y, "2 hours", or seconds.

    Raises:
        ValueError: it is none, or less than a second, or more than a thousand years.
    """
    match = _TIME.fullmatch(text.strip().lower())
    unit = (match["unit"] if match else "") or "s"
    unit = next((short for word, short in _SPELLED.items() if unit in (word, f"{word}s")), unit)
    try:
        seconds = float(match["number"]) * _ALL[unit] if match else 0.0
    except (ValueError, KeyError):
        seconds = 0.0
    if not 1 <= seconds <= LONGEST_S:
        raise ValueError(f"{text}: write a time, such as 10min, 1h, 30d or 1y")
    return seconds
