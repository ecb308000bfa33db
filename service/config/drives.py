"""The drive of an axis, as named or drawn in the configuration."""

from __future__ import annotations

from monitor_core.drive import Drive, Output
from monitor_core.modeling import ModelError
from service.config import drive_sources as modeling
from service.config.base_table import SUFFIX
from service.config.nominal import nominal_file_of
from service.config.positions import Keys
from service.config.schema import AxisConfig
from service.config.schema_model import ModelConfig


def drive_of(axis: AxisConfig, output: Output | None = None) -> Drive:
    """The drive of an axis, for the measured output, or for the ``output`` given.

    It includes the state of a torque disturbance if the nominal values were found with one.

    Raises:
        ModelError: the axis has none.
    """
    drive, found = plain_drive_of(axis, output), nominal_file_of(axis)
    return drive.with_disturbance() if found is not None and found.drive.torque_disturbance else drive


def plain_drive_of(axis: AxisConfig, output: Output | None = None) -> Drive:
    """The drive as it is drawn, where its sensor averages with a mean speed as output.

    Raises:
        ModelError: there is none.
    """
    drive = _modelled(axis, output).drive
    return drive.with_mean_speed() if output is None and axis.interval_mean else drive


def given_values(axis: AxisConfig) -> dict[str, float]:
    """The nominal values of the configuration and of the drawing, by the names they have there.

    Those of a file of nominal values take precedence over the drawing's; a cross-check compares them with the
    configuration. The values of the library are those of one robot, so they are not used.

    Raises:
        ModelError: the axis has no drive.
    """
    drawn = {} if is_library(axis.model) else _modelled(axis).values
    found = nominal_file_of(axis)
    return {**drawn, **axis.model.nominal, **(found.values if found else {})}


def _modelled(axis: AxisConfig, output: Output | None = None) -> modeling.Modelled:
    return modeling.model_of_axis(axis, output)


def is_library(model: ModelConfig) -> bool:
    """Whether the drive is one that comes with the program."""
    return not model.components and not model.drive.endswith(SUFFIX)


def place_of(error: ModelError, model: ModelConfig) -> Keys:
    """The key of a table [robot.axis.model] that an error of its drive belongs to."""
    if not model.components:
        return ("model", "drive")
    component = error.origin.component.split(".")[0]
    return ("model", "components", component) if component in model.components else ("model", "components")
