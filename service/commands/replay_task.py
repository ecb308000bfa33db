"""The replay of the frames around an alarm, in a process of its own that the daemon starts."""

from __future__ import annotations

import sys

from service.can.messages import DescriptionError
from service.can.user_errors import IngestError
from service.config.axis_settings import AxisError
from service.config.epoch_values import EpochValuesError, with_epoch
from service.ingest.records import read_record
from service.pipeline.replay_reports import ReplayOrder, give_way


def make(order: ReplayOrder) -> None:
    """Write the report.

    Raises:
        SystemExit: it cannot be made; with the reason.
    """
    give_way()
    from service.commands.output_files import replace_text
    from service.pipeline.axis_monitors import AxisMonitors
    from service.reports.replay_html import as_html
    from service.reports.replay_result import Replay

    config, epochs = order.config, order.epochs
    try:
        axes = [with_epoch(axis, *epochs[axis.id]) if axis.id in epochs else axis for axis in config.axes]
        record = read_record(order.record, config)
        run = Replay(AxisMonitors(axes), config, drawn=True)
        run.add(record, lambda _done: None)
        found = run.result([order.record.name], order.named)
        if not any(axis.course is not None and axis.course.used for axis in found.axes):
            sys.exit("no sample of its axes was of use: there is nothing to draw")
        replace_text(order.page, as_html(found))
    except (AxisError, DescriptionError, EpochValuesError, IngestError, OSError) as error:
        sys.exit(str(error))
