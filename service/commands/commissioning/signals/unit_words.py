"""Sentences about the units of signals, each the reason of a change that ``signal_units`` proposes."""

import math

from monitor_core.wording import Sentence, sentence


def unit(quantity: str, words: str) -> Sentence:
    """That a quantity is in a unit, as in "the torque is in N mm"."""
    return sentence("in unit", "the {quantity} is {unit}", quantity=quantity, unit=words)


def no_factor(quantity: str) -> Sentence:
    """That a quantity is in SI units already."""
    return sentence("no factor", "the {quantity} needs no factor", quantity=quantity)


def unit_in_name(in_tables: bool, quantity: str, words: str, text: str) -> Sentence:
    """That a text states a unit, in ``words``: the name of a column, or the description of the bus."""
    return sentence(
        "unit in name",
        "{place} says that the {quantity} is in {words}: {text}",
        place="the column" if in_tables else "the description of the bus",
        quantity=quantity,
        words=words,
        text=text,
    )


# --- What the records show --------------------------------------------------------------------------------------------


def weight_repeats(low: float, high: float) -> Sentence:
    """That a weight repeats after so many times the configured turn."""
    return sentence(
        "weight repeats",
        "the torque of the weight repeats with {low} to {high} times the configured turn of the arm",
        low=f"{low:.2g}",
        high=f"{high:.2g}",
    )


def inertia(shown: float, times: float) -> Sentence:
    """The inertia of one mass [kg m^2], which is so many times the nominal one."""
    words = "as one mass the drive shows an inertia of {inertia} kg m^2, {times} times the nominal"
    return sentence("shows inertia", words, inertia=f"{shown:.3g}", times=f"{times:.3g}")


def whole_numbers(shows: str, quantity: str) -> Sentence:
    """What the records show, and that the quantity is in whole numbers there."""
    words = "{shows}, and the {quantity} is in whole numbers"
    return sentence("whole numbers", words, shows=shows, quantity=quantity)


# --- What follows from it; ``shows`` is one of the above --------------------------------------------------------------


def unit_shown(shows: str, what: str) -> Sentence:
    """The unit that follows from a weight."""
    return sentence("is so", "{shows}: {what}", shows=shows, what=what)


def unit_likely(shows: str, what: str, times: float, sure: bool) -> Sentence:
    """The unit with which the inertia is so many times the nominal one."""
    words = "{shows}: {what}" if sure else "{shows}: probably {what}"
    return sentence(
        "then times" if sure else "probably",
        f"{words}; then it is {{times}} times",
        shows=shows,
        what=what,
        times=f"{times:.2g}",
    )


def counts(shows: str, found: float, power: int) -> Sentence:
    """The counts of a turn, and the power of two that they likely are."""
    return sentence(
        "counts",
        "{shows}: counts, about {counts} a turn of the motor, so likely 2^{power} = {likely}; the data sheet of the"
        " encoder says it",
        shows=shows,
        counts=f"{found:.3g}",
        power=power,
        likely=2**power,
    )


def per_mille(shows: str, rated: float) -> Sentence:
    """A torque in per mille of the rated one [N m]."""
    return sentence(
        "per mille",
        "{shows}: it is likely in per mille of a rated torque of about {rated} N m (by the nominal inertia; the name"
        " plate says it)",
        shows=shows,
        rated=f"{rated:g}",
    )


def gear_by_weight(shows: str, ratio: float) -> Sentence:
    """The gear with which a weight repeats as it does."""
    words = "{shows}: the gear ratio is about 1/{gear}; its data sheet says it"
    return sentence("gear by weight", words, shows=shows, gear=f"{1 / ratio:.3g}")


def gear_by_inertia(shows: str, ratio: float) -> Sentence:
    """The gear with which the nominal inertias of motor and arm are that of the records."""
    words = "{shows}: with the nominal inertias of motor and arm that is a gear of 1/{gear}; its data sheet says it"
    return sentence("gear by inertia", words, shows=shows, gear=f"{1 / ratio:.3g}")


def gear_turned(given: float) -> Sentence:
    """That a gear ratio is given the other way round."""
    return sentence(
        "r turned",
        "r = {r} would turn the arm faster than the motor; r is the angle of the arm over that of the motor,"
        " so it is given the other way round",
        r=f"{given:g}",
    )


def too_fast(speed: float) -> Sentence:
    """That no motor turns so fast [rad/s]."""
    return sentence(
        "too fast",
        "the motor would turn at {speed} revolutions per minute, which none does: the angle is likely in degrees",
        speed=f"{speed * 30 / math.pi:.3g}",
    )
