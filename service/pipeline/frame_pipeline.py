"""From frames to changed alarms: decoding of every bus, monitors of every axis; without clock, thread or file."""

from collections.abc import Iterable, Mapping

from service.can.frames import Frame, Sample
from service.config import Config
from service.ingest.bus_samples import Ingest, block_of
from service.pipeline.alarms import AxisAlarm
from service.pipeline.axis_monitors import AxisMonitors


class FramePipeline:
    """Ingest of every bus and the monitors of every axis.

    Raises:
        AxisError: an axis cannot be monitored as configured.
        DbcError, IngestError: a bus cannot be decoded as configured.
    """

    def __init__(self, config: Config) -> None:
        self.monitors = AxisMonitors(config.axes)
        self.ingests: Mapping[str, Ingest] = {bus.name: Ingest(config, bus.name) for bus in config.bus}
        self._samples: dict[str, list[Sample]] = {}

    def take(self, bus: str, frames: Iterable[Frame]) -> None:
        """Take frames of a bus, in the order of their receipt; their samples wait for ``update``."""
        self._keep(self.ingests[bus].feed(frames))

    def update(self) -> list[AxisAlarm]:
        """Pass all waiting samples to the monitors; returns the alarms that changed."""
        waiting, self._samples = self._samples, {}
        if not waiting:
            return []
        return self.monitors.update({axis_id: block_of(samples) for axis_id, samples in waiting.items()})

    def flush(self) -> None:
        """End of the frames: values without a partner are counted; the last samples wait for ``update``."""
        for ingest in self.ingests.values():
            self._keep(ingest.flush())

    def _keep(self, samples: Mapping[str, list[Sample]]) -> None:
        for axis_id, found in samples.items():
            self._samples.setdefault(axis_id, []).extend(found)
