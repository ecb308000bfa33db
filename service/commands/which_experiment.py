"""Which torque a command asks about: that of a record, through the configuration of an axis."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import typer

from service.commands.which_drive import axis_of

if TYPE_CHECKING:
    from monitor_core.excitation.local_identifiability import Experiment
    from service.config import AxisConfig

LONGEST = 20_000
"""Samples of a record that are looked at: more tell the same, only more exactly."""


def experiment_of(
    record: Path | None, config: Path | None, axis: str | None
) -> tuple[Experiment | None, float]:
    """The experiment of a record, None without one, and the speed scale of Coulomb friction.

    Raises:
        typer.BadParameter: a record without the configuration that says how to read it.
        RecordError: it cannot be read, or has fewer than two samples of the axis.
    """
    if config is None:
        if record is not None:
            raise typer.BadParameter(
                "goes with --config FILE, which says how to read it", param_hint="--record"
            )
        return None, 1.0
    from service.config import predictor_of

    found = axis_of(config, axis)
    speed_scale = predictor_of(found.config).friction_speed_scale
    return None if record is None else _read(record, config, found.id, found.config), speed_scale


def _read(path: Path, config: Path, axis_id: str, axis: AxisConfig) -> Experiment:
    from monitor_core.excitation.local_identifiability import Experiment
    from service.can.user_errors import RecordError
    from service.commands.configuration import configuration
    from service.config import predictor_of
    from service.ingest.records import read_record

    steps = read_record(path, configuration(config, without_bus=True)).steps()
    torques = [step.samples[axis_id].torque for step in steps if axis_id in step.samples]
    torque = np.concatenate(torques)[:LONGEST] if torques else np.empty(0)
    if len(torque) < 2:
        raise RecordError(f"{path}: no samples of {axis_id}")
    seconds = len(torque) * axis.sample_interval_s
    words = f"the torque of {path.name}, {seconds:.3g} s at {1 / axis.sample_interval_s:.4g} samples a second"
    return Experiment(torque, axis.sample_interval_s, words, predictor_of(axis).output_noise)
