"""``axiswatch alarms``: the alarms of a running daemon, and the actions of operators on them."""

from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import Annotated, Literal

import typer

from monitor_core.wording import Z90, percent, seconds_in
from service.client import AlarmAction, ApiAnswer, JsonValue, Remark
from service.commands.command_line.daemon_options import Daemon, asks_daemon, short_time
from service.commands.command_line.exit_codes import GROUP

AlarmIds = Annotated[list[int], typer.Argument(metavar="ID...", help="Numbers of the alarms.")]
AlarmStateName = Literal[
    "active", "unacknowledged", "acknowledged", "returned", "latched", "shelved", "suppressed",
    "out-of-service", "normal", "stale", "chattering",
]  # fmt: skip

alarms = typer.Typer(
    help="Alarms of a running daemon: list, show, acknowledge, shelve, comment; statistics; axes out of service.",
    **GROUP,
)


@alarms.command("list")
@asks_daemon
def list_alarms(
    daemon: Daemon,
    state: Annotated[
        AlarmStateName | None,
        typer.Option(
            "--state",
            help="Only these; active: not ended, or latched; stale: for more than 24 hours; chattering: three times"
            " within ten minutes.",
        ),
    ] = None,
    axis: Annotated[str | None, typer.Option("--axis", metavar="ROBOT.AXIS", help="Only of this axis.")] = None,
    limit: Annotated[int, typer.Option("--limit", min=1, max=1000, help="At most this number.")] = 100,
) -> None:
    """List alarms, the latest first."""
    found = daemon.client.alarms(state=state, axis=axis, limit=limit)
    if axis is not None and not found["alarms"]:
        daemon.client.axis(axis)  # a name with a slip must not read as "no alarm"
    none = "no alarm" + ("" if axis is None else f" of {axis}") + ("" if state is None else f" is {state}")
    left = found["total"] - len(found["alarms"])
    more = [f"{left} more"] if left > 0 else []
    daemon.show(found, [*map(alarm_lines, found["alarms"]), *more] or [none])


@alarms.command()
@asks_daemon
def show(daemon: Daemon, alarm_id: Annotated[int, typer.Argument(metavar="ID", help="Number of the alarm.")]) -> None:
    """Show an alarm, and all that has happened to it."""
    found = daemon.client.alarm(alarm_id)
    daemon.show(found, [alarm_lines(found), *(f"  {fact}" for fact in _facts(found))])


@alarms.command()
@asks_daemon
def ack(daemon: Daemon, alarm_ids: AlarmIds, remark: Remark) -> None:
    """Acknowledge alarms."""
    _act(daemon, alarm_ids, "acknowledge", remark)


@alarms.command()
@asks_daemon
def shelve(
    daemon: Daemon,
    alarm_ids: AlarmIds,
    remark: Remark,
    duration: Annotated[str | None, typer.Option("--for", metavar="TIME", help="How long: 8h, 3d, 30min.")] = None,
    until: Annotated[
        str | None,
        typer.Option("--until", metavar="TIME", help="2026-03-01T14:00:00Z, instead."),
    ] = None,
) -> None:
    """Hide alarms for a time, at most seven days; each comes back by itself."""
    if (duration is None) == (until is None):
        raise typer.BadParameter("give one of --for and --until")
    try:
        seconds = None if duration is None else seconds_in(duration)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--for") from None
    _act(daemon, alarm_ids, "shelve", remark, duration_s=seconds, until=until)


@alarms.command()
@asks_daemon
def unshelve(daemon: Daemon, alarm_ids: AlarmIds, remark: Remark) -> None:
    """Show alarms again before their time is over."""
    _act(daemon, alarm_ids, "unshelve", remark)


@alarms.command("comment")
@asks_daemon
def comment_alarm(daemon: Daemon, alarm_ids: AlarmIds, remark: Remark) -> None:
    """Add a comment, the number of a work order, or both, to alarms of any state."""
    if not any(remark):
        raise typer.BadParameter("give --comment, --work-order or both")
    _act(daemon, alarm_ids, "comment", remark)


@alarms.command()
@asks_daemon
def statistics(
    daemon: Daemon,
    since: Annotated[
        str | None,
        typer.Option(
            "--since",
            metavar="TIME",
            help="2026-03-01T14:00:00Z; default: seven days ago.",
        ),
    ] = None,
    until: Annotated[str | None, typer.Option("--until", metavar="TIME", help="Default: now.")] = None,
) -> None:
    """Print alarms per ten minutes (EEMUA 191), and the most frequent ones."""
    found = daemon.client.statistics(since, until)
    daemon.show(found, _statistics(found))


def _statistics(found: ApiAnswer) -> Iterator[str]:
    yield f"{short_time(found['since'])} to {short_time(found['until'])}"
    yield f"raised: {found['raised']}, announced: {found['announced']}"
    most = f"{found['most_in_ten_minutes']} at most"
    most += f" (from {short_time(found['most_at'])})" if found["most_at"] else ""
    yield f"announced in ten minutes: {found['mean_per_ten_minutes']:.3g} in the mean, {most}"
    yield f"ten minutes with more than ten: {100 * found['flood_share']:.3g} %"
    for name in found["most_frequent"]:
        yield f"{name['alarms']:6}  {name['axis']} {name['parameter']} {name['direction']}"


Axis = Annotated[str, typer.Argument(metavar="ROBOT.AXIS", help="The axis, as in `axiswatch alarms list`.")]


@alarms.command("out-of-service")
@asks_daemon
def out_of_service(daemon: Daemon, axis: Axis, remark: Remark) -> None:
    """Take an axis out of service: its alarms are recorded, but not announced."""
    found = daemon.client.change_service(axis, "out-of-service", remark)
    daemon.show(found, [_service_line(found, "taken out of service")])


@alarms.command("return-to-service")
@asks_daemon
def return_to_service(daemon: Daemon, axis: Axis, remark: Remark) -> None:
    """Return an axis to service: its alarms are announced again."""
    found = daemon.client.change_service(axis, "return-to-service", remark)
    daemon.show(found, [_service_line(found, "returned to service")])


def _service_line(found: ApiAnswer, done: str) -> str:
    step = found["steps"][-1]
    texts = "".join(f" ({text})" for text in (step["comment"], step["work_order"]) if text)
    return f"{found['axis']}: {done} by {step['who']} at {short_time(step['at'])}{texts}"


def _act(daemon: Daemon, alarm_ids: Sequence[int], action: AlarmAction, remark: Remark, **end: JsonValue) -> None:
    """Apply an action to each alarm; stops at the first alarm that refuses it."""
    for number in alarm_ids:
        found = daemon.client.act(number, action, remark, **end)
        daemon.show(found, [alarm_lines(found)])


def _facts(a: ApiAnswer) -> Iterator[str]:
    """Onset, size and certainty of an alarm as far as they are known, its recording, and its history."""
    best = datetime.fromisoformat(a["onset"])
    ends = [("-", a["onset_low"]), ("+", a["onset_high"])]
    away = " ".join(f"{sign}{abs(datetime.fromisoformat(end) - best).total_seconds():.1f}" for sign, end in ends if end)
    yield f"onset: {short_time(a['onset'])}" + (f" (90 %: {away} s)" if away else "")
    if a["size"] is not None:
        nominal = "" if a["nominal"] is None else f"; nominal value {a['nominal']:.4g}"
        sure = "" if a["size_sd"] is None else f" +- {Z90 * a['size_sd']:.2g} (90 %)"
        yield f"size: {a['size']:+.4g}{sure} {a['unit']}{nominal}"
    for cause in a["causes"]:
        alike = f"; {', '.join(cause['alike'])} would look the same" if cause["alike"] else ""
        yield f"cause: {cause['parameter']}, probability {percent(cause['probability'])}{alike}"
    if a["recording"] is not None:
        yield f"frames around it: {a['recording']}"
    for t in a["transitions"]:
        parts = [f"{short_time(t['at'])}  {t['event']} by {t['who']}: {t['to_state']}"]
        parts += [f"until {short_time(t['until'])}"] if t["until"] and t["event"] == "shelve" else []
        parts += [f"({text})" for text in (t["comment"], t["work_order"]) if text]
        yield " ".join(parts)


def alarm_lines(a: ApiAnswer) -> str:
    """An alarm in two lines: its state, and its message."""
    known = "" if a["id"] is None else f"{a['id']}"
    number = known if a["recorded"] else f"{known} not yet recorded".strip()
    state = a["state"] + (f" until {short_time(a['shelved_until'])}" if a["shelved_until"] else "")
    ended = f", ended {short_time(a['ended'])}" if a["ended"] else ""
    order = f", work order {a['work_order']}" if a["work_order"] else ""
    order += ", first-out" if a["first_out"] else f", follows alarm {a['follows']}" if a["follows"] else ""
    head = f"{number}  {a['axis']} {a['parameter']} {a['direction']}: {state}, {a['priority']} priority"
    return f"{head}, raised {short_time(a['raised'])}{ended}{order}\n    {a['words']}"
