"""Cross-checks of axes whose drive speaks CANopen: what the units follow from is given, and is not guessed."""

from __future__ import annotations

from collections.abc import Iterator

from service.config.problems import Finding
from service.config.schema import AxisConfig


def torque_of_drive(axis: AxisConfig) -> Iterator[Finding]:
    """What the torque is a thousandth of is given."""
    drive, kT = axis.canopen, axis.torque.kT_Nm_per_A
    if drive is None:
        return
    if drive.rated_torque_Nm is None and drive.rated_current_A is None:
        yield Finding(
            ("canopen", "rated_torque_Nm"),
            "missing: object 0x6077 is in thousandths of the rated torque of the motor, which is not guessed: read"
            " object 0x6076 (mN m) with the tool of the drive, and compare the data sheet of the motor; or use the"
            " current, object 0x6078: give rated_current_A (object 0x6075, mA) and torque.kT_Nm_per_A",
        )
    if drive.rated_torque_Nm is not None and drive.rated_current_A is not None:
        yield Finding(("canopen", "rated_current_A"), "give the rated torque or the rated current, not both")
    elif drive.rated_current_A is not None and kT is None:
        yield Finding(
            ("torque", "kT_Nm_per_A"),
            "missing: the current, object 0x6078, makes no torque without torque = { kT_Nm_per_A = ... }, the torque"
            " constant of the motor (data sheet) [N m/A]",
        )
    elif drive.rated_torque_Nm is not None and kT is not None:
        yield Finding(
            ("torque", "kT_Nm_per_A"), "object 0x6077 is a torque: remove this, or give rated_current_A"
        )


def motion_of_drive(axis: AxisConfig) -> Iterator[Finding]:
    """The units of position and velocity are given."""
    drive = axis.canopen
    if drive is None:
        return
    if drive.motion == "speed" and drive.speed_unit is None:
        yield Finding(
            ("canopen", "speed_unit"),
            'missing: object 0x606C is in a unit of the drive: "counts/s" or "rpm"; see the manual of the drive; of'
            " another unit give speed = { factor = ... }, too, which makes it rad/s of the motor",
        )
    counts = drive.motion == "angle" or drive.speed_unit == "counts/s"
    if counts and drive.counts_per_turn is None:
        yield Finding(
            ("canopen", "counts_per_turn"),
            "missing: the position is in counts: see the data sheet of the encoder, or object 0x608F; 360000 if the"
            " drive converts to thousandths of a degree",
        )
    if drive.side == "arm" and drive.motor_turns is None:
        yield Finding(
            ("canopen", "motor_turns"),
            'missing: with side = "arm" it tells how often the motor turns for one turn of the arm (data sheet of the'
            " gear)",
        )


CANOPEN_RULES = (torque_of_drive, motion_of_drive)
