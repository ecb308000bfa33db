"""What records leave open about the signals of an axis, with the key and the value that settle it."""

from __future__ import annotations

from collections.abc import Iterator

from service.can.left_out import left_out_words
from service.commands.checked_axis import FASTEST, Checked, fastest


def unknown_units(checked: Checked) -> Iterator[str]:
    """What remains open about the units, with the key and the value that settle it."""
    for source in checked.sources:
        if source.left_out:
            yield left_out_words(source.path, source.left_out)
    settled = checked.agrees
    is_torque = checked.axis.config.torque.kT_Nm_per_A is None
    if (
        checked.in_whole_numbers("torque")
        and is_torque
        and not settled
        and abs(checked.factor("torque")) == 1
    ):
        yield (
            "the torque is in whole numbers, as in per mille of the rated torque (CiA 402, object 6077h): set"
            " torque.factor to the rated torque of the name plate / 1000 [N m]; until then all torques, inertias and"
            " frictions are in that unit, and alarms, in percent, are the same"
        )
    if checked.in_whole_numbers("motion") and not settled and abs(checked.factor("motion")) == 1:
        weighed = any(p.name == "gc" for p in checked.drive.drawn)
        until = (
            "the weight of the arm cannot be found"
            if weighed
            else "inertias and frictions are in it, and alarms, in percent, are the same"
        )
        yield (
            f"the {checked.output} is in whole numbers, as counts are: set {checked.output}.factor to 2 pi / counts of"
            f" a turn of the motor (data sheet of the encoder) [rad]; until then {until}"
        )
    elif checked.output == "speed" and not settled and fastest(checked.records) > FASTEST:
        yield (
            f"no motor turns at {fastest(checked.records):.3g} rad/s: set speed.factor to 0.10472 for revolutions per"
            " minute, 0.0174533 for degrees per second"
        )
    times = checked.times_nominal
    if times is not None and not settled:
        yield (
            f"as one mass the drive shows {times:.3g} times the nominal inertia: check units, the gear ratio and"
            f" [robot.axis.model.nominal]; if the {checked.output} is that of the arm, {checked.output}.factor is the"
            " gear ratio, motor over arm"
        )


def unchecked(checked: Checked) -> str:
    """What nothing in the records could have shown; empty: all that is configured has been compared."""
    if checked.inertia_known:
        return ""
    ratio = "" if checked.ratio is None else f", and of the gear ratio r = {checked.ratio:g}"
    return (
        f"Units of torque and {checked.output} are taken as configured{ratio}: records show them beside the nominal"
        " inertias of [robot.axis.model.nominal], or where a weight acts."
    )
