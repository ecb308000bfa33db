"""Sentences about the measured temperature of an axis: which parameters follow it and how far, or why none does."""

from collections.abc import Iterator, Sequence

from monitor_core.drive import MARGIN, TEMPERATURE
from monitor_core.identification import IdentificationResult
from monitor_core.wording import listed, percent
from service.config import AxisConfig

_AS_GOOD = 0.9
"""Share of what the heat explains from which on a measured temperature is as good."""
_HALF_A_DAY_S = 43200.0
"""Records that begin so far apart are of several days."""


def temperature_remarks(axis: AxisConfig, result: IdentificationResult) -> Iterator[str]:
    """What follows the temperature of the axis, if that is measured, or why nothing does."""
    if all(signal.name != TEMPERATURE for signal in axis.signal) or result.options.thermal is None:
        return
    followed = [term for term in result.options.scheduled if term.term == TEMPERATURE]
    if followed:
        names, first, share = listed([term.parameter for term in followed]), followed[0], result.temperature_share
        reach = MARGIN * (first.high - first.low)
        yield (
            f"Follows the signal {TEMPERATURE}: {names}. In the records it is {first.low:.3g} to {first.high:.3g}."
            f" Below {first.low - reach:.3g} and above {first.high + reach:.3g} nothing is tested: record the axis as"
            " cold and as warm as it becomes, over the day and over the year."
        )
        if share is not None and share < _AS_GOOD:
            yield (
                f"The signal {TEMPERATURE} explains {percent(share)} of what the heat of the axis's own motion does,"
                " as a thermometer lags behind the gear. It is taken all the same, because it tells how cold or warm"
                " the hall is, which the heat does not."
            )
        if result.temperature_follows_motion is False:
            yield (
                f"The signal {TEMPERATURE} does not follow the motion of this axis: its course would be the same if the"
                " axis had always worked alike. It may be the temperature of something else, such as a cabinet or the"
                f" hall: if that thermometer is not on this axis, remove the signal {TEMPERATURE}."
            )
        elif result.temperature_follows_motion is None and not _of_days(result.options.begins_s):
            yield (
                "In records of one day the temperature of something else that rises meanwhile, as of a cabinet or of"
                f" the hall, looks the same: if that thermometer is not on this axis, remove the signal {TEMPERATURE}."
                " A record from cold on with a break of a quarter of an hour shows whether it follows the motion;"
                " records of days with a cold and with a warm hall show what the signal is worth."
            )
    elif result.warm_up is None or result.temperature_share is None:
        yield (
            f"Friction does not follow the signal {TEMPERATURE}: it does not clearly fall while that rises, or not"
            " alike in all parts of the records, or by more than a tenth for each degree. It may be the temperature of"
            " something else, such as a cabinet or the hall; or it is not in degrees, which a factor corrects."
        )
    elif result.temperature_follows_motion is False:
        yield (
            f"Friction does not follow the signal {TEMPERATURE}, because that does not follow the motion of this axis:"
            " its course would be the same if the axis had always worked alike. So it is the temperature of something"
            f" else, such as a cabinet or the hall; give that of this axis, or remove the signal {TEMPERATURE}. The"
            " heat of the axis's own motion is followed instead."
        )
    else:
        yield (
            f"Friction does not follow the signal {TEMPERATURE}: the heat of the axis's own motion explains it better;"
            f" the signal explains {percent(max(result.temperature_share, 0.0))} of that. It may be the temperature of"
            " something else, such as a winding, a board or a cabinet."
        )


def _of_days(begins_s: Sequence[float | None]) -> bool:
    """Whether records begin on several days, by the clock times of their first samples [s]; None: unknown."""
    known = [begins for begins in begins_s if begins is not None]
    return bool(known) and max(known) - min(known) > _HALF_A_DAY_S
