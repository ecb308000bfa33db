"""``axiswatch baseline``: new nominal values of an axis of a running daemon after a repair, or former values again."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from service.client import ApiAnswer, JsonValue, Remark
from service.commands.command_line.daemon_options import Daemon, asks_daemon, short_time
from service.commands.command_line.exit_codes import GROUP

Axis = Annotated[str, typer.Argument(metavar="ROBOT.AXIS", help="The axis, as in `axiswatch status`.")]
VerifyHours = Annotated[
    float,
    typer.Option(
        "--verify-hours",
        min=0.0,
        help="Hours of operation for which the new values are then verified; 0: not at all.",
    ),
]

baseline = typer.Typer(
    help="New nominal values of an axis of a running daemon: start, status, cancel, restore.", **GROUP
)


@baseline.command()
@asks_daemon
def start(
    daemon: Daemon,
    axis: Axis,
    remark: Remark,
    hours: Annotated[
        float | None,
        typer.Option(
            "--hours",
            metavar="NUMBER",
            help="Learn from so many hours of operation, from now on.",
        ),
    ] = None,
    nominal: Annotated[
        Path | None,
        typer.Option("--nominal", metavar="FILE", help="Use this nominal.toml at once."),
    ] = None,
    thresholds: Annotated[
        Path | None,
        typer.Option("--thresholds", metavar="FILE", help="With --nominal: its thresholds.toml."),
    ] = None,
    verify_hours: VerifyHours = 8.0,
) -> None:
    """Begin a new epoch of an axis after a repair.

    With `--hours` its nominal values are learned from its own estimates in normal work; its thresholds stay. With
    `--nominal` (and `--thresholds`) they are those of another commissioning. The other axes are not touched.
    """
    if (hours is None) == (nominal is None):
        raise typer.BadParameter("give one of --hours and --nominal")
    if thresholds is not None and nominal is None:
        raise typer.BadParameter("--thresholds needs --nominal")
    plan: dict[str, JsonValue] = {
        "mode": "files" if hours is None else "window",
        "hours": hours,
        "nominal": _text(nominal, "--nominal"),
        "thresholds": _text(thresholds, "--thresholds"),
        "verify_hours": verify_hours,
    }
    found = daemon.client.baseline(axis, remark, **plan)
    daemon.show(found, _lines(found))


@baseline.command()
@asks_daemon
def status(daemon: Daemon, axis: Axis) -> None:
    """Show the epochs of an axis, the newest first."""
    found = daemon.client.epochs(axis)
    daemon.show(found, (line for epoch in found["epochs"] for line in _lines(epoch)))


@baseline.command()
@asks_daemon
def cancel(daemon: Daemon, axis: Axis, remark: Remark) -> None:
    """End the learning window of an axis: the epoch before stays in force."""
    found = daemon.client.cancel_baseline(axis, remark)
    daemon.show(found, _lines(found))


@baseline.command()
@asks_daemon
def restore(
    daemon: Daemon,
    axis: Axis,
    number: Annotated[int, typer.Argument(metavar="EPOCH", min=1, help="Number of a former epoch.")],
    remark: Remark,
    verify_hours: VerifyHours = 8.0,
) -> None:
    """Restore the values of a former epoch."""
    found = daemon.client.restore_epoch(axis, number, verify_hours, remark)
    daemon.show(found, _lines(found))


def _text(path: Path | None, option: str) -> str | None:
    if path is None:
        return None
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise typer.BadParameter(f"cannot read {path}: {why}", param_hint=option) from None


def _lines(e: ApiAnswer) -> Iterator[str]:
    """Lines about an epoch: its state, the source of its values, comments, its values."""
    head = f"epoch {e['number']}: {e['state'].replace('_', ' ')}"
    if e["length_s"] is not None:
        head += f", {(e['done_s'] or 0) / 3600:.3g} of {e['length_s'] / 3600:.3g} h of operation"
    if e["restored_from"] is not None:
        head += f", the values of epoch {e['restored_from']}"
    else:
        head += f", from {_SOURCES[e['source']]}"
    order = f", work order {e['work_order']}" if e["work_order"] else ""
    ended = f", ended {short_time(e['ended'])}" if e["ended"] else ""
    yield f"{head}; by {e['who']} at {short_time(e['began'])}{order}{ended}"
    for text in (e["comment"], e["reason"]):
        if text:
            yield f"    {text}"
    for v in e["values"]:
        sd = "" if v["standard_deviation"] is None else f" +- {v['standard_deviation']:.2g}"
        former = "" if v["former"] in (None, v["value"]) else f" (before: {v['former']:.6g})"
        unit = "" if v["unit"] == "1" else f" {v['unit']}"
        kept = f" ({v['kept']})" if v["kept"] else ""
        yield f"    {v['name']} = {v['value']:.6g}{sd}{unit}{former}{kept}"


_SOURCES = {
    "configuration": "the configuration",
    "files": "files",
    "window": "a learning window",
    "restored": "a former epoch",
}
