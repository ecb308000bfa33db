"""Cross-checks of the coupling of the motors of a robot: what is added to the motion of an axis exists and fits it."""

from collections.abc import Iterator

from monitor_core.drive import OF_ANGLE
from monitor_core.wording import did_you_mean
from service.config.problems import CheckFinding
from service.config.rules.model_rules import usable_drive
from service.config.schema import AxisConfig, FurtherSignalConfig, RobotConfig
from service.config.schema.base_table import Undecidable
from service.config.schema.robot_defaults import COUPLING, DEFAULTS
from service.config.toml_lines import Keys


def defaults_without_coupling(robot: RobotConfig) -> Iterator[CheckFinding]:
    """The defaults of a robot contain no coupling, as no axis is coupled with itself."""
    if COUPLING in robot.defaults:
        message = "remove this: it differs from axis to axis, so give it in [[robot.axis]]"
        yield CheckFinding((DEFAULTS, COUPLING), message)


def coupling(robot: RobotConfig) -> Iterator[CheckFinding]:
    """What is added to the motion of an axis is the same motion of another axis, or a signal of the axis."""
    others = {other.name: other for other in robot.axis}
    for k, axis in enumerate(robot.axis):
        signals = {s.name: s for s in axis.signal}
        for name in axis.coupling:
            if name == axis.name:
                problem = "is the axis itself: name the axes whose motion also turns its motor"
            elif name in others:
                problem = _no_partner(axis, others[name])
            elif name in signals:
                problem = _no_motion(axis, signals[name])
            else:
                known = [other for other in others if other != axis.name]
                problem = f"no axis of that name: {did_you_mean(name, known)}"
            if problem:
                yield CheckFinding(_key(k, name), problem)


def may_be_coupled(axis: AxisConfig, other: AxisConfig) -> bool:
    """Whether the motion of another axis of the same robot can be added to that of an axis."""
    try:
        return axis.name != other.name and not _no_partner(axis, other)
    except Undecidable:
        return False


def _no_partner(axis: AxisConfig, other: AxisConfig) -> str:
    """Why the motion of another axis cannot be added; empty: it can."""
    if (axis.angle is None) == (axis.speed is None) or (other.angle is None) == (other.speed is None):
        raise Undecidable("angle or speed")  # another check reports that
    if axis.output != other.output:
        return (
            f"{other.name} has no {axis.output}, as this axis has, but a {other.output}: give both an angle, or both a"
            " speed"
        )
    if other.angle is not None and other.angle.wrap_period is not None:
        return (
            f"the angle of {other.name} wraps after each turn, and the coupling does not count its turns: use an angle"
            " that does not wrap"
        )
    if axis.bus != other.bus:
        return f"it is on the bus {other.bus}, this axis on {axis.bus}: coupled axes are on one bus"
    if not other.is_sampled_as(axis):
        return (
            f"it is sampled every {other.sample_interval_s:g} s, this axis every {axis.sample_interval_s:g} s: a sample"
            " takes the motions of both at its time"
        )
    return ""


def _no_motion(axis: AxisConfig, signal: FurtherSignalConfig) -> str:
    """Why a signal cannot be added to the motion of an axis; empty: it can."""
    if signal.axis is not None:
        return f"this signal is the motion of {signal.axis}: name that axis"
    if signal.is_derivative:
        return "this signal is taken from an angle by time: name one that is an angle as it is measured"
    if signal.message is None and not axis.records_only:
        return "this signal is on no bus: give it message and signal"
    return ""


def weight_of_coupled(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The drive of a coupled axis has no weight: that turns with the arm, and the angle in the drive is the motor's."""
    if axis.coupling and any(kind in OF_ANGLE for kind in usable_drive(axis).inputs):
        message = (
            f"with coupling, the angle in the drive is that of the motor, and the weight in {axis.model.drive} turns"
            " with the arm: use the drive without it, and let tau0 follow the angle of the axis as a signal, as in"
            f' signal = [{{ name = "own", axis = "{axis.name}" }}] and tau0: cos(own), sin(own)'
        )
        yield CheckFinding(("model", "drive"), message)


def _key(axis: int, name: str) -> Keys:
    return ("axis", axis, COUPLING, name)
