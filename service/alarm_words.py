"""What an alarm says, in one sentence."""

import math

from monitor_core.drive import DELAY


def alarm_words(parameter: str, size: float, nominal: float, unit: str) -> str:
    """An alarm in words: "fm is 0.018 N m s/rad (30 %) above its nominal value".

    Args:
        parameter: its name.
        size: its estimate minus its nominal value, in ``unit``.
        nominal: its nominal value, in ``unit``.
        unit: "1" for a ratio.
    """
    if parameter == DELAY:
        return _skew(size, nominal)
    share = f" ({_digits(abs(100 * size / nominal))} %)" if nominal else ""
    amount = _digits(abs(size)) + ("" if unit == "1" else f" {unit}")
    return f"{parameter} is {amount}{share} {'below' if size < 0 else 'above'} its nominal value"


def _skew(size: float, nominal: float) -> str:
    """Torque and motion no longer go together in time: a matter of the bus, or of the drive's current loop."""
    now = nominal + size
    if nominal:
        way, acts = "later than usual" if size > 0 else "earlier than usual", _ms(now)
    else:
        way, acts = "late" if size > 0 else "early", "that much"
    side = "after" if now > 0 else "before"
    return f"the torque frame is {_ms(size)} {way}: the torque acts {acts} {side} its sample"


def _ms(seconds: float) -> str:
    return f"{_digits(1000 * abs(seconds))} ms"


def _digits(value: float) -> str:
    """Two significant digits, as a size is hardly ever known better; all of a whole number."""
    if not math.isfinite(value):
        return "?"
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"
