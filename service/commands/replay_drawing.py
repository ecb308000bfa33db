"""The report of a replay: courses collected while it runs, the page written afterwards."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import typer

from monitor_core.monitoring import AxisMonitor, AxisTrace
from monitor_core.samples import SampleBlock
from service.commands.exit_codes import MISTAKE
from service.commands.output_files import page_in, write
from service.commands.replay_report import Report, remarks_of
from service.config import NamedAxis
from service.reports.replay_course import Course
from service.reports.replay_result import Replayed, ReplayedAxis


class Drawing:
    """Collects the courses while records are run, and writes the page.

    Raises:
        typer.Exit: the page could not be written.
    """

    def __init__(self, where: Path, monitors: Mapping[str, AxisMonitor]) -> None:
        self._path = page_in(where, "replay.html")
        self._courses = {axis_id: Course(monitor) for axis_id, monitor in monitors.items()}

    def see(self, axis_id: str, block: SampleBlock, trace: AxisTrace) -> None:
        """Add the results of the detectors at samples of an axis."""
        self._courses[axis_id].take(block.t_us, trace.estimator, trace.crossings, trace.multimodel)

    def write(self, report: Report, config: Path, records: Sequence[Path]) -> None:
        """The page.

        Raises:
            typer.Exit: there is nothing to draw, or the file cannot be written.
        """
        from service.reports.replay_html import as_html

        if not any(course.used for course in self._courses.values()):
            names = ", ".join(map(str, records))
            print(f"axiswatch: no sample of any axis in {names}: there is nothing to draw", file=sys.stderr)
            raise typer.Exit(MISTAKE)
        axes = [self._axis(report, axis) for axis in report.config.axes]
        command = shlex.join(["axiswatch", *sys.argv[1:]])
        date = datetime.now(UTC).isoformat(timespec="seconds")
        record_names = [record.name for record in records]
        write(
            self._path,
            as_html(
                Replayed(
                    axes,
                    report.frames_dropped,
                    record_names,
                    str(config),
                    command,
                    version("axiswatch"),
                    date,
                )
            ),
        )
        print(f"written: {self._path}", file=sys.stderr)

    def _axis(self, report: Report, axis: NamedAxis) -> ReplayedAxis:
        monitor = report.monitors.by_id[axis.id]
        status = monitor.status()
        return ReplayedAxis(
            id=axis.id,
            drive=monitor.model.drive.name,
            status=status,
            course=self._courses[axis.id],
            alarms=report.alarms(axis.id),
            quantities={e.parameter: report.quantity(axis.id, e.parameter) for e in report.alarms(axis.id)},
            dropped=report.dropped_of(axis.id),
            clock=report.clock[axis.id],
            trends=[trend for trend in report.monitors.trends.for_axis(axis.id) if trend.trend is not None],
            notes=[*(f"{axis.id}: {words}" for words in status.confounded), *remarks_of(report, axis)],
        )
