"""``axiswatch restore``: creates a folder from a backup."""

from pathlib import Path
from typing import Annotated

import typer

from service.commands.command_line.exit_codes import explained

Archive = Annotated[Path, typer.Argument(metavar="ARCHIVE", help="What `axiswatch backup` has written.")]
Into = Annotated[Path, typer.Option("--into", metavar="DIR", help="A new folder, or an empty one.")]


def restore(archive: Archive, into: Into) -> None:
    """Make a folder with the configuration and the state of a backup, all or nothing.

    Each file is compared with its SHA-256 in the archive, and each database is checked. The daemon runs with the
    configuration in the new folder. Files that lay elsewhere are below `outside` in it; the state is in it, too.
    """
    from service.store.archive import ArchiveError, restore_archive

    with explained(ArchiveError):
        manifest = restore_archive(archive, into)
    typer.echo(f"{into}: {len(manifest.files)} files of {manifest.made}, axiswatch {manifest.axiswatch}")
    for place, name in manifest.renamed.items():
        typer.echo(f"{place} is now {into / name}", err=True)
    for name in manifest.left_out:
        typer.echo(f"not in the archive, as it is secret: copy it to {into / name}", err=True)
    typer.echo(f"next: axiswatch check --config {into / manifest.configuration}", err=True)
