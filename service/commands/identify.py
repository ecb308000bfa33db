"""``axiswatch identify``: from records of the healthy axis to its nominal values, and a report about them."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from enum import StrEnum
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.commands.configuration import ConfigPath, configuration
from service.commands.exits import MISTAKE, explained
from service.commands.identify_files import Files
from service.commands.optional_value import OptionalValueCommand
from service.commands.which_drive import axis_named

if TYPE_CHECKING:
    from monitor_core.identification.problem import Predictor
    from service.config import NamedAxis
    from service.identification.beginning import Start
    from service.identification.found import Provenance


class Command(OptionalValueCommand):
    """--json alone writes to standard output."""

    options = ("--json",)

    @staticmethod
    def is_value(word: str) -> bool:
        """Whether the word after the option is a file to write to, and not a record."""
        return word == "-" or word.endswith(".json") or word.startswith("/dev/")


class Beginning(StrEnum):
    """Where the fit starts."""

    SEARCH = "search"
    VALUES = "values"
    RECORDS = "records"


class Kind(StrEnum):
    """How the motion is predicted."""

    INNOVATIONS = "innovations"
    OUTPUT_ERROR = "output-error"


Records = Annotated[
    list[str],
    typer.Argument(
        metavar="RECORD...",
        help="Tables (.csv .parquet .mat) or CAN logs (.log .asc .blf .trc) of the healthy axis; FILE@10:60 are its"
        " seconds 10 to 60.",
    ),
]
Axis = Annotated[
    str | None,
    typer.Option("--axis", metavar="NAME", help="Which axis, if there are several; its name, or robot.axis."),
]
Free = Annotated[
    list[str] | None,
    typer.Option(
        "--free",
        metavar="NAMES",
        help='Only these parameters, "Jm,fm,1/Ja". Default: all that can be told with kT and r held.',
    ),
]
Fix = Annotated[
    list[str] | None,
    typer.Option("--fix", metavar="NAMES", help="These stay at their nominal values, beside kT and r."),
]
PredictorOption = Annotated[
    Kind | None, typer.Option("--predictor", help="How the motion is predicted. Default: as configured.")
]
Varying = Annotated[
    list[str] | None,
    typer.Option(
        "--varying",
        metavar="NAME:SIGNALS",
        help='This parameter follows signals of [[robot.axis.signal]]: "fm: temperature"; "Ja: payload, cos(angle2)".'
        " Of a signal there are cos, sin and square.",
    ),
]
Validate = Annotated[
    list[str] | None,
    typer.Option("--validate", metavar="RECORD", help="Also predict this record, which is not fitted."),
]
Delay = Annotated[bool, typer.Option("--delay", help="Also find by how much the torque acts late.")]
Slow = Annotated[
    float | None,
    typer.Option(
        "--disturbance",
        metavar="SECONDS",
        min=1e-3,
        help="What disturbs the torque also has a slow part with this time constant, a state of the model.",
    ),
]
HoldNoise = Annotated[
    bool,
    typer.Option(
        "--hold-noise",
        help="The gain follows from torque_noise and output_noise as configured. Default: from noise found in the"
        " records.",
    ),
]
Robust = Annotated[bool, typer.Option("--robust", help="Outliers count less (Huber's loss).")]
StartOption = Annotated[
    Beginning | None,
    typer.Option(
        "--start",
        help="Where the fit starts: at the configured values and where a search around them ends; there only (fast);"
        " or at what the records alone tell. Default: search; records where the configuration has no values.",
    ),
]
Folder = Annotated[
    Path | None,
    typer.Option("--output-dir", metavar="DIR", help="Where nominal.toml and report.html go. Default: here."),
]
Output = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="FILE", help="The nominal values; default nominal.toml."),
]
Report = Annotated[
    Path | None, typer.Option("--report", metavar="FILE", help="The report; default report.html beside them.")
]
JsonFile = Annotated[
    Path | None,
    typer.Option(
        "--json", metavar="[FILE]", help="Also write everything here; - or nothing is standard output."
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite nominal values that are there already.")]


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
    output_dir: Folder = None,
    output: Output = None,
    report: Report = None,
    json: JsonFile = None,
    force: Force = False,
) -> None:
    """Find the nominal values of an axis in records of it, while it is healthy.

    Writes nominal.toml, which the configuration of the daemon points at, and report.html. Where a parameter cannot be
    told or the fit does not converge, the report says so, there are no nominal values, and the exit code is 2.
    """
    files = Files.of(output_dir, output, report, json)
    files.check(force)
    read = configuration(config, without_bus=True)
    chosen = axis_named(read.axes, axis)
    with explained():
        from service.identification.running import run
        from service.identification.task import Wishes, task_of

        kind = _kind(predictor)
        wishes = Wishes(
            _names(free),
            _names(fix),
            kind,
            delay,
            disturbance,
            hold_noise,
            robust,
            _start(start),
            tuple(varying or ()),
        )
        task = task_of(read, chosen, records, validate or [], wishes)
        with _shown(chosen.id) as progress:
            found = run(task, _provenance(chosen), progress)
    files.write(found)
    if why_not := found.trustworthy():
        print(f"axiswatch: no nominal values: {why_not}", file=sys.stderr)
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


def _names(given: list[str] | None) -> tuple[str, ...]:
    """Names with commas between them, or an option for each; those of merged parameters hold blanks."""
    return tuple(name.strip() for part in given or [] for name in part.split(",") if name.strip())


def _provenance(axis: NamedAxis) -> Provenance:
    from service.identification.found import Provenance
    from service.identification.provenance import drawing_of

    command = shlex.join(["axiswatch", *sys.argv[1:]])
    date = datetime.now(UTC).isoformat(timespec="seconds")
    return Provenance(version("axiswatch"), date, command, drawing_of(axis.config))


@contextmanager
def _shown(name: str) -> Iterator[Callable[[str, int, int], None]]:
    """A bar of the steps of what is going on, on the error stream where that is a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(name)

        def told(words: str, done: int, most: int) -> None:
            progress.update(task, completed=done, total=most, description=f"{name}: {words}")

        yield told
