"""``axiswatch demo --commission``: the whole way from a robot to its monitor, on the simulated one, in a folder.

Each step is the one of the command that a user would take: a record, ``init``, ``commission``, the bus.  Called again,
only what depends on something new is computed again.
"""

from __future__ import annotations

from pathlib import Path

import typer
from rich.console import Console

from service.commands.commission import CONFIG, commission
from service.commands.init import init
from service.commands.output_files import replace_text
from service.commands.progress import progress_bar
from service.config import Config
from service.config.commissioned import relocated
from service.config.connected import connected
from service.simulation.healthy_table import table_lines

RECORD, FIRST = "healthy.csv", "axis.toml"
_SEED = 1
_PROPOSED = 'name = "robot1"'
"""By init, which does not know the robot."""


def commission_robot(source: Path, robot: Config, folder: Path, minutes: float, budget: str) -> Path:
    """Record, describe, commission and connect the simulated robot; returns the configuration that ``run`` takes.

    ``source`` is its configuration, ``robot`` the same as read, with the axes that are wanted.

    Raises:
        typer.Exit: an axis could not be commissioned; the report in the folder says why.
    """
    console = Console(highlight=False, soft_wrap=True)
    record, first, made = folder / RECORD, folder / FIRST, folder / CONFIG
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise typer.BadParameter(f"{folder}: {error.strerror}", param_hint="--output") from None

    console.print(f"[bold]1. Record[/] {minutes:g} minutes of the healthy robot: {record}")
    with progress_bar(record.name) as progress:
        replace_text(record, "".join(table_lines(robot, 60 * minutes, _SEED, progress)))

    console.print(f"[bold]2. Describe it[/]: axiswatch init {record} --output {first}")
    init(record, first, force=True)
    name = f'name = "{robot.robot[0].name}"'
    replace_text(first, first.read_text(encoding="utf-8").replace(_PROPOSED, name))

    console.print(
        f"[bold]3. Commission it[/]: axiswatch commission {record} --config {first} --budget {budget}"
        f" --output {folder}"
    )
    commission(first, [str(record)], folder, budget, yes=True)

    console.print(f"[bold]4. Add the bus[/], and run it: axiswatch run --config {made}")
    signals = relocated(source.read_text(encoding="utf-8"), source.parent, folder.resolve())
    text = connected(
        made.read_text(encoding="utf-8"), signals, f"The bus and the signals are those of {source.name}."
    )
    replace_text(made, text)
    return made
