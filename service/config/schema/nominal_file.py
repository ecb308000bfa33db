"""nominal.toml, the result of `axiswatch identify`: the keys that configuration and daemon use."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field, model_validator

from monitor_core.drive import Drive, Output, split_name
from monitor_core.settings import DOUBTFUL, TOGETHER
from service.config.schema.base_table import NotNegative, Positive, Real
from service.config.schema.found_file import FoundFile, FoundTable


class DriveTable(FoundTable):
    """[drive]: the drive that the values belong to."""

    name: str
    structure: str
    output: Output
    torque_disturbance: bool
    friction_speed_scale: Positive
    coupling: tuple[Real, ...] = ()
    """Factors of the motions of other axes in that of the motor, in ascending order"""


class PredictorTable(FoundTable):
    """[predictor]: the predictor of the identification, with the filter gain K: x+ = x + K eps.

    ``colour``: prediction errors are autocorrelated, so estimates scatter as if the innovation variance were larger by
    this factor.
    """

    kind: Literal["innovations", "output-error"]
    interval_s: Positive
    torque_delay_s: NotNegative
    innovation_variance: Positive
    largest_error: NotNegative = 0.0
    """One in ten thousand |eps| of the records is larger, in the unit of the output; 0 in files of earlier versions"""
    colour: Annotated[Real, Field(ge=1)] = 1.0
    states: tuple[str, ...]
    gain: tuple[Real, ...]
    min_speed: NotNegative = 0.0
    """Slower motion was left out of the fit [rad/s at the sensor]; 0 in files of earlier versions"""

    @property
    def lam0(self) -> float:
        """lambda_0 that gives correct standard deviations of the recursive estimates."""
        return self.innovation_variance * self.colour

    @model_validator(mode="after")
    def _one_for_each_state(self) -> PredictorTable:
        needed = len(self.states) if self.kind == "innovations" else 0
        if len(self.gain) != needed:
            raise ValueError(f"gain has {len(self.gain)} numbers, must have {needed} with {self.kind}")
        return self


class NoiseTable(FoundTable):
    """[noise]: standard deviations of torque [N m] and output [rad or rad/s]; 0: not known."""

    torque: NotNegative = 0.0
    output: NotNegative = 0.0


class ScheduleTable(FoundTable):
    """[[schedule]]: parameter = value + slope (signal - reference)."""

    parameter: str
    signal: str
    slope: Real
    standard_deviation: NotNegative
    reference: Real
    range: tuple[Real, Real]
    model_error: NotNegative = 0.0
    """Standard deviation of what the parameter is off by beside a temperature; 0: of another signal, or not judged"""


class ThermalTable(FoundTable):
    """[thermal]: the heat that parameters follow, heat' = (P - heat) / tau, P = fm w^2 + fc |w| [W]."""

    time_constant_s: Positive
    fast_time_constant_s: Positive | None = None
    """time constant of the faster part of the heat; none: there is only one time constant"""
    fast_share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.5
    """share of the faster part in the heat of a lasting motion"""
    viscous_friction: NotNegative
    coulomb_friction: NotNegative
    largest_w: Positive
    ambient_w: NotNegative = 0.0
    """standard deviation of what a colder or warmer hall adds to the heat; 0: in files of earlier versions"""
    first_w: NotNegative | None = None
    """Heat at the start of the first record, 0: assumed cold; None in files of earlier versions"""
    model_error: dict[str, NotNegative] = Field(default_factory=dict)
    """Standard deviations of the error that the warm-up correction leaves, by parameter; empty in earlier versions"""

    @model_validator(mode="after")
    def _some_friction(self) -> ThermalTable:
        if not self.viscous_friction + self.coulomb_friction > 0:
            raise ValueError("viscous_friction and coulomb_friction are both 0: nothing would warm up")
        if self.fast_time_constant_s is not None and self.fast_time_constant_s >= self.time_constant_s:
            raise ValueError("fast_time_constant_s must be below time_constant_s")
        return self


class CorrelationTable(FoundTable):
    """[correlation]: correlation matrix of the estimates."""

    names: tuple[str, ...] = ()
    matrix: tuple[tuple[Real, ...], ...] = ()

    @model_validator(mode="after")
    def _square(self) -> CorrelationTable:
        if {len(row) for row in self.matrix} - {len(self.names)} or len(self.matrix) != len(self.names):
            raise ValueError(f"matrix is not {len(self.names)} by {len(self.names)}, as names are")
        return self


class RecordTable(FoundTable):
    """[[record]]: the records used, in the order given."""

    sha256: str
    range_s: tuple[Real, Real]


class NominalFile(FoundFile):
    """The whole file."""

    axis: str
    date: str
    drive: DriveTable
    predictor: PredictorTable
    noise: NoiseTable
    values: dict[str, Real] = Field(min_length=1)
    schedule: tuple[ScheduleTable, ...] = ()
    thermal: ThermalTable | None = None
    standard_deviations: dict[str, NotNegative] = Field(default_factory=dict)
    correlation: CorrelationTable = CorrelationTable()
    record: tuple[RecordTable, ...] = ()

    def unidentifiable_pairs(self, monitored: Sequence[str]) -> tuple[tuple[str, str], ...]:
        """Pairs of a monitored parameter and another parameter that the record hardly distinguishes.

        Nominal values of such parameters fit the motion of the record, and may be far off with another motion.
        """
        monitored = [split_name(name)[0] for name in monitored]
        names, found = self.correlation.names, list[tuple[str, str]]()
        for name, row in zip(names, self.correlation.matrix, strict=True):
            if split_name(name)[0] not in monitored or self._is_accurate(name):
                continue
            others = [(abs(r), other) for r, other in zip(row, names, strict=True) if other != name]
            strongest, other = max(others, default=(0.0, ""))
            if strongest > TOGETHER and (other, name) not in found:
                found.append((name, other))
        return tuple(found)

    def _is_accurate(self, name: str) -> bool:
        base, inverse = split_name(name)
        value = abs(self.values.get(base, 0.0))
        size = 1 / value if inverse and value else value
        return self.standard_deviations.get(name, 0.0) <= DOUBTFUL * size


def structure_of(drive: Drive) -> str:
    """A digest of A, B, C and the states of a drive, independent of the values of its parameters."""
    parts = [drive.output, *(f"{s.name} [{s.unit}]" for s in drive.states), *map(str, drive.inputs)]
    parts += sorted(f"{t.matrix}{t.row},{t.col}: {t.coefficient:.12g} {sorted(t.powers)}" for t in drive.terms)
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]
