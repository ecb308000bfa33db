"""The keys of the model of an axis: drive, nominal values, monitored parameters, limits."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from service.config.base_table import DriveName, FilePath, Positive, Real, Table, Text


class ScheduleConfig(Table):
    """[[robot.axis.model.schedule]]: nominal value = that of the model + slope * (signal - reference)."""

    parameter: Text = Field(description='a monitored parameter, or its reciprocal: "fm", "Ja"')
    signal: Text = Field(
        description="a signal of [[robot.axis.signal]], or cos, sin or square of one: cos(angle2)"
    )
    slope: Real = Field(description="change of the parameter for each unit of the signal, in its SI unit")
    reference: Real = Field(description="where the signal is when the parameter has the value of the model")
    range: tuple[Real, Real] | None = Field(
        None, description="[lowest, highest] of the signal; a tenth of it beyond, nothing is estimated"
    )


def _one_or_two(value: object) -> object:
    return (value,) if isinstance(value, int | float) and not isinstance(value, bool) else value


Limits = Annotated[tuple[Real, ...], BeforeValidator(_one_or_two), Field(min_length=1, max_length=2)]
"""A limit, above or below the nominal value, or [lower, upper]."""


class ModelConfig(Table):
    """[robot.axis.model]: the drive, its nominal values, and the monitored parameters."""

    drive: DriveName = Field(
        "three-mass", description='name of a drive that comes with the program, or a file "....mo"'
    )
    drive_model: Text | None = Field(None, description="which model, of a Modelica file with more than one")
    components: dict[str, dict[str, Any]] = Field(
        default_factory=dict,
        description="the drive drawn here, in place of one by name: name = { type, at, ... }",
    )
    monitor: tuple[Text, ...] = Field(
        min_length=1, description='parameters to estimate, e.g. ["kT", "1/Ja", "fm"]'
    )
    friction_speed_scale: Positive = Field(
        1.0, description="Coulomb friction is fc tanh(speed at its flange / friction_speed_scale) [rad/s]"
    )
    nominal: dict[str, Real] = Field(
        default_factory=dict,
        description="value of every parameter of the drive, SI; takes precedence over the drawing's",
    )
    nominal_file: FilePath | None = Field(
        None,
        description="what `axiswatch identify` wrote: nominal values with their gain; relative to this file",
    )
    thresholds_file: FilePath | None = Field(
        None,
        description="what `axiswatch calibrate` wrote: thresholds of the tests; relative to this file",
    )
    scales: dict[str, Positive] = Field(
        default_factory=dict, description="size of a monitored parameter, where |nominal| is not it"
    )
    bounds: dict[str, tuple[Real, Real]] = Field(
        default_factory=dict, description="name = [lower, upper]: the estimate stays between them"
    )
    limits: dict[str, Limits] = Field(
        default_factory=dict,
        description="name = limit, or [lower, upper], of a monitored parameter or its reciprocal: when it will be"
        " reached is foretold",
    )
    schedule: tuple[ScheduleConfig, ...] = Field(
        (), description="nominal values that follow signals, beside those of the nominal_file"
    )
    conditions: Literal["followed", "gated", "others stand still"] | None = Field(
        None,
        description="how the pose of the other axes, payload and temperature are dealt with: nominal values follow"
        " them, gates keep them the same, or they do not change",
    )
