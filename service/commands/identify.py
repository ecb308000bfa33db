"""``axiswatch identify``: nominal values of an axis from records of it, with a report."""

from __future__ import annotations

import shlex
import sys
from datetime import UTC, datetime
from importlib.metadata import version
from typing import TYPE_CHECKING

import typer

from service.commands.configuration import ConfigPath, OptionalValueCommand, configuration
from service.commands.drive_choice import axis_named
from service.commands.exit_codes import MISTAKE, explained
from service.commands.identify_arguments import (
    Axis,
    Beginning,
    Delay,
    Fix,
    Folder,
    Force,
    Free,
    HoldNoise,
    JsonFile,
    Kind,
    MassesOption,
    Output,
    PredictorOption,
    Records,
    Report,
    Robust,
    Slow,
    StartOption,
    Validate,
    Varying,
)
from service.commands.output_files import Files
from service.commands.progress import steps_bar

if TYPE_CHECKING:
    from monitor_core.identification import Predictor, Start
    from service.config import NamedAxis
    from service.reports.identification_report import Provenance


class Command(OptionalValueCommand):
    """--json alone writes to standard output."""

    options = ("--json",)

    @staticmethod
    def is_value(word: str) -> bool:
        """Whether the word after the option is a file to write to, and not a record."""
        return word == "-" or word.endswith(".json") or word.startswith("/dev/")


def identify(
    config: ConfigPath,
    records: Records,
    axis: Axis = None,
    free: Free = None,
    fix: Fix = None,
    varying: Varying = None,
    predictor: PredictorOption = None,
    validate: Validate = None,
    delay: Delay = False,
    disturbance: Slow = None,
    hold_noise: HoldNoise = False,
    robust: Robust = False,
    start: StartOption = None,
    masses: MassesOption = None,
    output_dir: Folder = None,
    output: Output = None,
    report: Report = None,
    json: JsonFile = None,
    force: Force = False,
) -> None:
    """Identify the nominal values of an axis from records of its healthy state.

    Writes nominal.toml, which the configuration of the daemon refers to, and report.html. If a parameter cannot be
    identified or the fit does not converge, the report says so, no nominal values are written, and the exit code is 2.
    """
    files = Files.chosen(output_dir, output, report, json)
    files.check(force)
    read = configuration(config, without_bus=True)
    chosen = axis_named(read.axes, axis)
    with explained():
        from service.commands.identification_task import Request, prepare

        kind = _kind(predictor)
        request = Request(
            _names(free),
            _names(fix),
            kind,
            delay,
            disturbance,
            hold_noise,
            robust,
            _start(start),
            tuple(varying or ()),
            _masses(masses),
        )
        task = prepare(read, chosen, records, validate or [], request)
        with steps_bar(chosen.id) as progress:
            result = task.run(_provenance(chosen), progress)
    files.write(result)
    if result.rejection:
        print(f"axiswatch: no nominal values: {result.rejection}", file=sys.stderr)
        raise typer.Exit(MISTAKE)


def _kind(predictor: Kind | None) -> Predictor | None:
    """As the engine calls it."""
    kinds: dict[Kind, Predictor] = {Kind.INNOVATIONS: "innovations", Kind.OUTPUT_ERROR: "output-error"}
    return None if predictor is None else kinds[predictor]


def _start(start: Beginning | None) -> Start | None:
    starts: dict[Beginning, Start] = {
        Beginning.SEARCH: "search",
        Beginning.VALUES: "values",
        Beginning.RECORDS: "records",
    }
    return None if start is None else starts[start]


def _masses(text: str | None) -> int | None:
    """How many at most.

    Raises:
        typer.BadParameter: it is neither auto nor a number of masses.
    """
    from monitor_core.identification import MOST_MASSES, USUAL_MASSES

    if text is None:
        return None
    if text == "auto":
        return USUAL_MASSES
    if not (text.isdecimal() and 1 <= int(text) <= MOST_MASSES):
        raise typer.BadParameter(f"{text}: write auto, or 1 to {MOST_MASSES}", param_hint="--masses")
    return int(text)


def _names(given: list[str] | None) -> tuple[str, ...]:
    """Names separated by commas, or one option for each; names of merged parameters contain blanks."""
    return tuple(name.strip() for part in given or [] for name in part.split(",") if name.strip())


def _provenance(axis: NamedAxis) -> Provenance:
    from service.commands.identification_task import drawing_of
    from service.reports.identification_report import Provenance

    command = shlex.join(["axiswatch", *sys.argv[1:]])
    date = datetime.now(UTC).isoformat(timespec="seconds")
    return Provenance(version("axiswatch"), date, command, drawing_of(axis.config))
