"""An axis whose signals are checked: its records as configured, and known values of its drive."""

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Literal

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification import (
    KnownAxis,
    Record,
    is_about_nominal,
    known_axis,
    shown_inertia,
    whole_numbers,
)
from service.commands.commissioning.axis.identification_task import known_values
from service.config import Config, NamedAxis
from service.config.drive_sources import model_of_axis
from service.config.schema import SignalConfig
from service.config.unit_names import unit_as_recorded
from service.ingest.records.loaded_records import Loaded
from service.ingest.records.recorded_units import Signal, unit_text

SIGNALS: tuple[Signal, ...] = ("torque", "motion")
FASTEST = 2000.0
"""Speed [rad/s] (19 000 revolutions per minute) that no motor of a robot reaches."""


class RecordedAxis:
    """An axis to check: its records as configured, and the known values of its drive."""

    def __init__(self, config: Config, axis: NamedAxis, loaded: Sequence[Loaded], in_tables: bool) -> None:
        self.config, self.axis, self.in_tables = config, axis, in_tables
        self.records, self.sources = [item.record for item in loaded], [item.source for item in loaded]
        self.drive = model_of_axis(axis.config).drive
        self.values, self._unknown = known_values(axis, self.drive)

    @cached_property
    def known(self) -> KnownAxis:
        """Known quantities from the nominal values."""
        return self._known_with(self.values)

    def _known_with(self, values: Mapping[str, float]) -> KnownAxis:
        scale = self.axis.config.model.friction_speed_scale
        return known_axis(self.drive, values, 0, scale, self._unknown)

    def inertia_with(self, changed: Mapping[str, float]) -> float:
        """The nominal inertia with these values changed."""
        return self._known_with({**self.values, **changed}).inertia or math.inf

    @cached_property
    def shown(self) -> tuple[float, float] | None:
        """Inertia [kg m^2] and Coulomb friction [N m] from the records, modelled as one mass; None: not determined."""
        found = [mass for record in self.records if (mass := shown_inertia(record, self.known)) is not None]
        found = [mass for mass in found if mass.inertia > 0]
        if not found:
            return None
        middle = sorted(found, key=lambda mass: mass.inertia)[len(found) // 2]
        return middle.inertia, middle.torques["coulomb"]

    @property
    def times_nominal(self) -> float | None:
        """Ratio of the inertia in the records to the nominal one; None: one of them is not known."""
        nominal = self.known.inertia
        if nominal is None or not 0 < nominal < math.inf or self.shown is None:
            return None
        return self.shown[0] / nominal

    @property
    def agrees(self) -> bool:
        """Whether the inertia in the records is about the nominal one."""
        return self.times_nominal is not None and is_about_nominal(self.times_nominal)

    @property
    def ratio(self) -> float | None:
        """Gear ratio of the drive; None: no gear."""
        names = {p.name for p in (*self.drive.parameters, *self.drive.drawn)}
        return abs(self.values["r"]) if "r" in names and self.values.get("r") else None

    @property
    def output(self) -> Literal["angle", "speed"]:
        """The measured motion."""
        return "angle" if self.axis.config.output == "angle" else "speed"

    def source(self, signal: Signal) -> SignalConfig:
        """The configured source of a signal."""
        return self.axis.config.torque if signal == "torque" else self.axis.config.motion

    def quantity(self, signal: Signal) -> Literal["torque", "angle", "speed"]:
        """The quantity of a signal."""
        return "torque" if signal == "torque" else self.output

    def factor(self, signal: Signal) -> float:
        """The configured factor of a signal."""
        return self.source(signal).factor

    def key(self, signal: Signal) -> tuple[str, ...]:
        """Configuration key of the factor."""
        return (self.quantity(signal), "factor")

    def raw(self, signal: Signal) -> Floats:
        """The unscaled values of all records, as they are in the files."""
        values = np.concatenate([values_of(record, signal) for record in self.records])
        factor, offset = self.source(signal).scale
        return np.asarray((values - offset) / factor)

    def in_whole_numbers(self, signal: Signal) -> bool:
        """Whether all values of the signal are whole numbers."""
        return whole_numbers(self.raw(signal))

    def unit_text(self, signal: Signal) -> str:
        """Text that may state the unit of the signal."""
        return unit_text(self.config, self.axis, signal, self.sources[0].path)

    def is_as_recorded(self, signal: Signal) -> bool:
        """Whether the signal is in a unit that depends on the drive, according to its name."""
        text, quantity = self.unit_text(signal), self.quantity(signal)
        return unit_as_recorded(text, quantity, self.factor(signal)) is not None


def values_of(record: Record, signal: Signal) -> Floats:
    """The torque, or the motion where it is measured (N,)."""
    return record.u if signal == "torque" else record.y[record.measured]
