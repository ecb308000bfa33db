"""Finds the load of links on an axis, where the angles may be those of motors before gears of unknown ratio.

The angle of a motor turns by far more than that of an arm does.  Its gear ratio is found first (``gear_ratios``), then
the terms of the load (``arm_links``).  Where no ratio is found, the load may still be that of a linear axis.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.torque_windows import leaves_much_less
from monitor_core.identification.weight.arm_links import ArmSignals, LinkWeights, link_terms, link_weights
from monitor_core.identification.weight.gear_ratios import gear_ratios

_MOST_TURN = 4 * np.pi
"""Largest range of the angle of an arm's axis [rad]; a larger one is that of a motor before its gearbox."""


class ArmLoad(NamedTuple):
    """The load on an axis."""

    weights: LinkWeights
    """Its terms, in angles of the arm"""
    ratios: Mapping[str, float]
    """Arm angle over motor angle, of those signals that are angles of motors in the records"""


def arm_load(records: Sequence[Record], signals: ArmSignals) -> ArmLoad | None:
    """The load of links on an axis, or terms that may explain too little to be one (``LinkWeights.is_load``).

    None: the records are too short.  ``records``: of the axis, with these signals, which vary there
    (``recorded_signals``).
    """
    own, motors = signals.own, motor_angles(records, signals)
    ratios = gear_ratios(records, own, signals.angles, motors, signals.accelerations)
    angles = [name for name in signals.angles if _extent(records, name) < _MOST_TURN or name in ratios]
    behind_gears = [_behind_gears(record, ratios) for record in records]
    found = link_terms(behind_gears, signals._replace(angles=angles if own in angles else []))
    if own in motors and own in signals.moving and signals.loads:
        # It may be a linear axis, whose load follows no angle.
        plain = link_weights(records, signals._replace(angles=()))
        if plain is not None and (
            found is None or not found.is_load or not leaves_much_less(found.explained, plain.explained)
        ):
            return ArmLoad(plain, {})
    return None if found is None else ArmLoad(found, ratios)


def recorded_signals(records: Sequence[Record], signals: ArmSignals) -> ArmSignals:
    """Those of the signals that all records have; loads and accelerations must also vary in each of them."""

    def varying(names: Iterable[str]) -> list[str]:
        return [name for name in names if all(_extent([record], name) > 0 for record in records)]

    angles = [name for name in signals.angles if math.isfinite(_extent(records, name))]
    moving = {name: motion for name, motion in signals.moving.items() if name in angles}
    loads, accelerations = varying(signals.loads), varying(signals.accelerations)
    return signals._replace(angles=angles, loads=loads, accelerations=accelerations, moving=moving)


def motor_angles(records: Sequence[Record], signals: ArmSignals) -> list[str]:
    """The angles that turn by more than those of an arm, and so are those of motors before their gears."""
    turning = [name for name in signals.angles if _extent(records, name) >= _MOST_TURN]
    return [name for name in turning if name not in signals.of_arm]


def _extent(records: Sequence[Record], name: str) -> float:
    """Largest range of a signal in a record [rad]; NaN: it is not known in all of them."""
    known = [record.signals.get(name, np.zeros(0)) for record in records]
    known = [values[np.isfinite(values)] for values in known]
    return float(max(np.ptp(values) for values in known)) if all(values.size for values in known) else math.nan


def _behind_gears(record: Record, ratios: Mapping[str, float]) -> Record:
    """The record with angles of the arm instead of those of the motors."""
    turned = {name: ratio * record.signals[name] for name, ratio in ratios.items()}
    return replace(record, signals={**record.signals, **turned})
