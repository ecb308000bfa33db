"""Describes a long-term trend in a sentence: whether it drifts and when it reaches a limit, always with an interval."""

from datetime import UTC, datetime

from monitor_core.detection import Reach
from monitor_core.trend import Trend
from service.texts.instants import DATED_US

SURE_COURSE = 0.9
"""Probability above which a kind of course is reported alone; less certain ones with their probabilities."""

_DAY_S = 86400.0
_UNITS = (
    (1.0, "second", 120.0),
    (60.0, "minute", 7200.0),
    (3600.0, "hour", 72 * 3600.0),
    (_DAY_S, "day", 730 * _DAY_S),
)
"""Units of time, each with the longest time that is given in it [s]."""
_YEAR_S = 365.25 * _DAY_S


def trend_words(name: str, unit: str, t: Trend | None) -> str:
    """The course in words: "fm drifts up by 0.0012 +- 0.0001 N m s/rad per day", or steady, changed, or undecided."""
    if t is None:
        return f"{name}: too little data yet to detect a drift"
    p = t.probability
    drift = p["drift"] + p["both"]
    per_day = f"{_amount(abs(t.slope) * _DAY_S, unit, 2)} ± {_amount(t.slope_sd * _DAY_S, '1', 2)} per day"
    way = "up" if t.slope > 0 else "down"
    if drift >= SURE_COURSE:
        after = f" since it changed {_when(t)}" if p["both"] > p["drift"] else ""
        return f"{name} drifts {way} by {per_day}{after}"
    if p["steady"] >= SURE_COURSE:
        return f"{name} is steady: {_amount(t.level, unit)} ± {_amount(t.level_sd, '1', 2)}"
    if p["step"] >= SURE_COURSE:
        change = "rose" if t.change > 0 else "fell"
        size = f"{_amount(abs(t.change), unit, 2)} ± {_amount(t.change_sd, '1', 2)}"
        return f"{name} {change} at once by {size}, {_when(t)}"
    shares = sorted({"steady": p["steady"], "drift": drift, "step": p["step"]}.items(), key=lambda s: -s[1])
    likely = [(kind, share) for kind, share in shares if share >= 0.05]
    kinds = " or ".join(kind for kind, _ in likely)
    parts = ":".join(f"{100 * share:.0f}" for _, share in likely)
    return f"{name}: {kinds}, {parts}; {way} by {per_day} in the mean"


def reach_words(r: Reach, now_us: int) -> str:
    """When a limit is reached: "fm reaches 0.09 N m s/rad in 12 to 20 days".

    Args:
        r: the limit, and when it is reached.
        now_us: the time from which to count.
    """
    limit = _amount(r.limit, r.unit)
    low_s = max(0.0, (r.low_us - now_us) / 1e6)
    if r.state == "beyond":
        side = "above" if r.above else "below"
        return f"{r.name} has been {side} {limit} {_since(r, now_us)}"
    if r.state == "far":
        return f"{r.name} = {limit} is not in sight: not within {_times(low_s)}"
    if r.high_us is None:
        return f"{r.name} reaches {limit} in {_times(low_s)} or later, perhaps never"
    high_s = max(low_s, (r.high_us - now_us) / 1e6)
    return f"{r.name} reaches {limit} in {_times(low_s, high_s)}"


def _since(r: Reach, now_us: int) -> str:
    ends = [r.low_us, r.low_us if r.high_us is None else r.high_us]
    if ends[0] >= DATED_US:
        first, last = (_date(t) for t in ends)
        return f"since {first}" if first == last else f"since a time between {first} and {last}"
    later, sooner = (max(0.0, (now_us - t) / 1e6) for t in ends)
    return f"for {_times(sooner, later)}"


def _when(t: Trend) -> str:
    if t.change_us >= DATED_US:
        return f"about {_date(t.change_us)}"
    return f"about {_times((t.time_us - t.change_us) / 1e6)} before the end"


def _date(t_us: int) -> str:
    return datetime.fromtimestamp(t_us / 1e6, UTC).strftime("%Y-%m-%d %H:%M UTC")


def _times(*seconds: float) -> str:
    """An interval of time such as "12 to 20 days" or "12 days", in the unit of its end."""
    scale, name = _unit(seconds[-1])
    return f"{' to '.join(_round(s / scale) for s in seconds)} {name}s"


def _unit(seconds: float) -> tuple[float, str]:
    return next(((s, name) for s, name, most in _UNITS if seconds <= most), (_YEAR_S, "year"))


def _round(value: float) -> str:
    if value >= 9.95:
        return f"{value:.0f}"
    return f"{value:.1f}".removesuffix(".0")


def _amount(value: float, unit: str, digits: int = 4) -> str:
    """Four digits of a level or a limit, two digits of an uncertain value."""
    return f"{value:.{digits}g}" if unit == "1" else f"{value:.{digits}g} {unit}"
