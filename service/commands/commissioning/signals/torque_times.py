"""Corrects the time of the torques of a robot by halves of a sample, as its axes together show it."""

from collections.abc import Iterator, Mapping

from monitor_core.identification import TorqueTime, times_of_robot
from service.config import AxisConfig, Config
from service.config.schema import MOST_LATE
from service.config.written.corrections import Correction

_IN_BETWEEN = 0.5


def torque_times(config: Config, times: Mapping[str, TorqueTime | None]) -> dict[str, Correction]:
    """Axes whose torque belongs to another time than configured, by name, each with the right ``late_samples``.

    ``times``: of the torques of axes as they are received; None: the records of the axis do not show it.
    """
    found: dict[str, Correction] = {}
    for robot in config.robot:
        axes = {axis.id: axis.config for axis in config.axes if axis.robot == robot.name and axis.id in times}
        for axis_id, time in times_of_robot({axis_id: times[axis_id] for axis_id in axes}).items():
            late, interval_s = axes[axis_id].torque.late_samples, axes[axis_id].sample_interval_s
            right = min(time.halves(interval_s), MOST_LATE)
            if right != late:
                found[axis_id] = Correction(("torque", "late_samples"), right, _reason(right, interval_s))
    return found


def torque_time_doubts(config: AxisConfig, shown: TorqueTime | None) -> Iterator[str]:
    """Remark that the torque of an axis is late if none is configured to be; ``shown``: by its own records."""
    interval_s = config.sample_interval_s
    if shown is None or config.torque.late_samples:  # that is by all axes of the robot together
        return
    if late := min(shown.halves(interval_s), MOST_LATE):
        why = _reason(late, interval_s)
        yield f"{why[0].upper()}{why[1:]}. Set late_samples = {late:g} in [robot.axis.torque], and identify again."


def _reason(late: float, interval_s: float) -> str:
    if late == 0:
        return "the torque of a sample acts until the next one, and does not come late"
    if late == _IN_BETWEEN:
        return f"the torque changes between one sample and the next, {interval_s:.3g} s later: the mean of both acts"
    return (
        f"the torque comes {late * interval_s:.3g} s later than the motion that it has caused, as a filtered one does"
    )
