"""The replay of the frames around an alarm, in a process of its own that the daemon starts."""

import sys

from service.can.messages import DescriptionError
from service.can.user_errors import IngestError
from service.commands.command_line.output_files import replace_text
from service.config.axis_settings import AxisError
from service.config.epoch_values import EpochValuesError, with_epoch
from service.ingest.records.record_files import read_record
from service.pipeline.persistence.replay_reports import ReplayOrder, give_way


def write_report(order: ReplayOrder) -> None:
    """Write the report.

    Raises:
        SystemExit: the report cannot be made; with the reason.
    """
    give_way()
    from service.pipeline.axes.axis_monitors import AxisMonitors
    from service.reports.replay_html import as_html
    from service.reports.replay_result import Replay

    config, epochs = order.config, order.epochs
    try:
        axes = [with_epoch(axis, *epochs[axis.id]) if axis.id in epochs else axis for axis in config.axes]
        record = read_record(order.record, config)
        run = Replay(AxisMonitors(axes), config, drawn=True)
        run.add(record, lambda _done: None)
        found = run.result([order.record.name], order.named)
        if not found.can_be_drawn:
            sys.exit("no sample of its axes could be used: there is nothing to draw")
        replace_text(order.page, as_html(found))
    except (AxisError, DescriptionError, EpochValuesError, IngestError, OSError) as error:
        sys.exit(str(error))
