"""The skew between torque and motion as a monitored parameter, ``monitor = [.., "delay"]``.

It is no parameter of the drawing: every drive can have it; its nominal value is ``torque_delay_s`` of the axis.
"""

from __future__ import annotations

from monitor_core.drive import DELAY, Drive, Output
from service.config.drives import drive_of, given_values
from service.config.nominal import nominal_file_of
from service.config.schema import AxisConfig

SCALE = 0.5
"""Of a sample interval.  A tenth of an interval late, which reads as 3 % of motor inertia, then counts as a fifth of
any other parameter does; with smaller scales a change of the arm's inertia by a fifth is often taken for a skew."""


def watches_skew(axis: AxisConfig) -> bool:
    """Whether the delay of the torque is monitored."""
    return DELAY in axis.model.monitor


def watched_drive(axis: AxisConfig, output: Output | None = None) -> Drive:
    """The drive of an axis as it is monitored: with the delay of its torque as a parameter, where that is watched.

    Raises:
        ModelError: it has none.
    """
    drive = drive_of(axis, output)
    return drive.with_delay() if watches_skew(axis) and not has_own_delay(drive) else drive


def watched_values(axis: AxisConfig) -> dict[str, float]:
    """The nominal values of the monitored drive, as ``given_values``."""
    own = {DELAY: nominal_skew(axis)} if watches_skew(axis) else {}
    return given_values(axis) | own


def nominal_skew(axis: AxisConfig) -> float:
    """How late the torque of the healthy axis acts [s]."""
    found = nominal_file_of(axis)
    return axis.torque_delay_s if found is None else found.predictor.torque_delay_s


def scales_of(axis: AxisConfig) -> dict[str, float]:
    """Sizes of monitored parameters, by name, where |nominal| is not the size."""
    own = {DELAY: SCALE * axis.sample_interval_s} if watches_skew(axis) else {}
    return own | axis.model.scales


def bounds_of(axis: AxisConfig) -> dict[str, tuple[float, float]]:
    """Bounds of monitored parameters, by name, where they differ from the defaults.

    A skew is followed up to one interval: beyond that the torque would be that of another sample.
    """
    h = axis.sample_interval_s
    own = {DELAY: (-h, h)} if watches_skew(axis) and nominal_skew(axis) < h else {}
    return own | axis.model.bounds


def has_own_delay(drive: Drive) -> bool:
    """Whether the drawing has a parameter of that name, which is something else."""
    return any(p.name == DELAY for p in (*drive.parameters, *drive.drawn))
