"""``axiswatch token``: access tokens of the API of the daemon."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from monitor_core.wording import did_you_mean
from service.commands.command_line.exit_codes import EPILOG, GROUP, explained
from service.commands.command_line.options import ConfigPath, configuration
from service.store.tokens import (
    ANYONE,
    LOCAL,
    NAME,
    NOBODY,
    TOKENS_FILE,
    NameTakenError,
    NoSuchTokenError,
    Scope,
    TokenFile,
)

token = typer.Typer(
    name="token",
    help="Who may use the API of the daemon: tokens, with a name and a scope. They are kept in the state directory of"
    " the configuration, as hashes; a running daemon applies a change at once.",
    **GROUP,
)

Name = Annotated[str, typer.Argument(metavar="NAME", help="Holder of the token: letters, digits, - and _.")]


@token.command(epilog=EPILOG)
def new(
    name: Name,
    config: ConfigPath,
    scope: Annotated[
        Scope,
        typer.Option("--scope", help="read: see everything; operate: read, and act on alarms; admin: everything."),
    ],
) -> None:
    """Create a token and print it, only this once: only its hash is stored."""
    if not NAME.fullmatch(name) or name in (LOCAL, ANYONE, NOBODY):
        raise typer.BadParameter(
            f"{name}: must be letters, digits, - and _, at most 64; {LOCAL}, {ANYONE} and {NOBODY} are reserved",
            param_hint="NAME",
        )
    file = _file(config)
    first = not file.exists
    with explained(NameTakenError):
        secret = file.new(name, scope)
    if first:
        typer.echo("From now on the daemon answers nobody without a token but /healthz.", err=True)
    typer.echo(f"Token {name}, scope {scope}; it is shown only now. Header: Authorization: Bearer TOKEN", err=True)
    typer.echo(secret)


@token.command("list", epilog=EPILOG)
def list_tokens(config: ConfigPath) -> None:
    """Show the names of the tokens, what they may do, and since when."""
    file = _file(config)
    with explained():
        tokens = file.tokens()
    if not tokens:
        typer.echo(f"no token in {file.path}")
        return
    table = Table("name", "scope", "made (UTC)")
    for each in tokens:
        table.add_row(escape(each.name), each.scope, each.created)
    Console().print(table)


@token.command(epilog=EPILOG)
def revoke(name: Name, config: ConfigPath) -> None:
    """Remove a token; the next request with it is refused."""
    file = _file(config)
    with explained():
        try:
            left = file.revoke(name)
        except NoSuchTokenError as error:
            hint = did_you_mean(name, error.known) if error.known else "there is none at all"
            raise typer.BadParameter(f"{error}: {hint}", param_hint="NAME") from None
    typer.echo(f"{name} is revoked")
    if not left:
        typer.echo(
            f"No token is left, so the daemon answers nobody. To open it to everyone on this machine again: delete"
            f" {file.path}, and restart the daemon.",
            err=True,
        )


def _file(config: Path) -> TokenFile:
    return TokenFile(configuration(config, without_bus=True).service.state_dir / TOKENS_FILE)
