"""Options that say what breaks in a simulated robot."""

from collections.abc import Mapping
from typing import Annotated

import typer

from monitor_core.drive.structure import DELAY

FaultOption = Annotated[
    list[str] | None,
    typer.Option(
        "--fault",
        metavar="PARAMETER=FACTOR",
        help="What breaks: a parameter gets so many times its value: fm=1.3, 1/Ja=0.8; or, delay=0.0005, the torque "
        "acts so many seconds late. May be repeated.",
    ),
]
FaultAxis = Annotated[
    str | None,
    typer.Option("--fault-axis", metavar="AXIS", help="In which axis; its name, or robot.axis."),
]
FaultAfter = Annotated[
    float,
    typer.Option("--fault-after", min=0.0, metavar="SECONDS", help="When it breaks, after it began to move."),
]


def factors(options: list[str]) -> dict[str, float]:
    """{"fm": 1.3} from ["fm=1.3"].

    Raises:
        typer.BadParameter: not of that form.
    """
    found = {}
    for text in options:
        name, _, factor = text.partition("=")
        try:
            found[name.strip()] = float(factor)
        except ValueError:
            raise typer.BadParameter(
                f"{text!r}: must be PARAMETER=FACTOR, e.g. fm=1.3", param_hint="--fault"
            ) from None
    return found


def in_words(changes: Mapping[str, float]) -> str:
    """What breaks: fm x 1.3."""
    parts = (f"torque {1000 * v:g} ms late" if k == DELAY else f"{k} x {v:g}" for k, v in changes.items())
    return ", ".join(parts)


def axis_id(name: str, known: list[str]) -> str:
    """The full name of an axis that may be given without its robot.

    Raises:
        typer.BadParameter: there is no such axis, or more than one.
    """
    found = [k for k in known if name in (k, k.split(".", 1)[1])]
    if len(found) != 1:
        what = "is in more than one robot" if found else "is not there"
        raise typer.BadParameter(f"{name} {what}; there is {', '.join(known)}", param_hint="--fault-axis")
    return found[0]
