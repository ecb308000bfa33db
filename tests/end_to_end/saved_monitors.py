"""What a daemon left in its checkpoints."""

from pathlib import Path

from monitor_core.monitoring import AxisMonitor
from service.config import load
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.store.checkpoints import Checkpoint, Checkpoints


def saved(config_file: Path) -> dict[str, AxisMonitor]:
    """The monitors as the daemon has left them."""
    config = load(config_file, {})
    monitors = AxisMonitors(config.axes).by_id
    checkpoints = Checkpoints(config.service.state_dir / "checkpoints.sqlite")
    for axis_id, monitor in monitors.items():
        found = checkpoints.load(axis_id, monitor.key, 0)
        assert isinstance(found, Checkpoint)
        monitor.from_arrays(found.arrays)
    checkpoints.close()
    return dict(monitors)
