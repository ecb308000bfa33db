"""Simulated axes as their user has them: thresholds by the command's way, monitors after a restart of the daemon."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from monitor_core.calibration import CalibrationOptions
from service.commands.command_line.options import configuration
from service.commands.commissioning.axis.calibration_task import as_identified, calibrate_axis
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.pipeline.persistence.checkpointing import Checkpointer
from service.pipeline.persistence.restoring import restore
from service.reports.calibration_files import as_toml
from service.reports.formats import Provenance
from service.store.checkpoints import Checkpoints
from service.store.journal import Journal


class CommandRefusedError(Exception):
    """A command found nothing that it could stand for; the text is the end of what it says."""


def write_thresholds(config: Path, records: Sequence[Path], options: CalibrationOptions) -> None:
    """AXIS-thresholds.toml beside the configuration, for each of its axes, from these records."""
    read = configuration(config, without_bus=True, thresholds=False)
    provenance = Provenance("1.2.3", "2002-02-02T02:02:02+00:00", "axiswatch calibrate")
    paths = [str(path) for path in records]
    for axis in read.axes:
        known, axis = as_identified(read, axis, paths)
        text = as_toml(calibrate_axis(known, axis, paths, options, provenance))
        (config.parent / f"{axis.config.name}-thresholds.toml").write_text(text, encoding="utf-8")


def restarted(config: Path, monitors: AxisMonitors, now_us: int) -> AxisMonitors:
    """Other monitors, which carry on from the checkpoint of these."""
    other = AxisMonitors(configuration(config, without_bus=True).axes)
    with tempfile.TemporaryDirectory() as folder:
        checkpoints = Checkpoints(Path(folder) / "checkpoints.sqlite")
        journal = Journal(Path(folder) / "alarms.sqlite")
        Checkpointer(checkpoints, monitors, 60.0, lambda: now_us).save()
        restored = restore(other, checkpoints, journal, now_us)
        checkpoints.close()
        journal.close()
    assert restored.messages == ()
    return other
