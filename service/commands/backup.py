"""``axiswatch backup``: configuration and state in one file, while the daemon runs."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

from service.commands.exit_codes import explained
from service.commands.options import ConfigPath, Force, configuration
from service.commands.output_files import check_new
from service.texts.instants import iso, now_us

Output = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE", help="The archive, a .tar.gz for its owner alone.")
]
Secrets = Annotated[
    bool,
    typer.Option(
        "--secrets", help="With the tokens of the API, the private key of TLS and the secrets of links."
    ),
]


def backup(config: ConfigPath, output: Output, secrets: Secrets = False, force: Force = False) -> None:
    """Keep configuration and state in one archive; the daemon may run on.

    The archive holds the configuration and every file that it names, the report of its commissioning, and the state
    directory: alarms and what was done about them, checkpoints, history; each database as it is at one moment.
    Recordings of frames are left out, and so are secrets, unless they are wanted. `axiswatch restore` takes it.
    """
    from service.config.bundle import bundle
    from service.store.archive import FORMAT, Manifest, state_files, write_archive
    from service.store.tokens import TOKENS_FILE

    read = configuration(config, without_bus=True)
    check_new(output, force)
    with explained(OSError):
        found = bundle(config, read)
        state = {f"{found.state}/{name}": file for name, file in state_files(read.service.state_dir).items()}
        files = found.files | state
        secret = {*found.secrets, f"{found.state}/{TOKENS_FILE}"} & files.keys()
        left_out = [] if secrets else sorted(secret)
        sources: dict[str, Path | bytes] = {
            found.name: found.text.encode(),
            **{name: file for name, file in files.items() if name not in left_out},
        }
        manifest = Manifest(
            FORMAT, version("axiswatch"), iso(now_us()), found.name, found.renamed, left_out, {}
        )
        written = write_archive(output, manifest, sources)
    size = sum(int(entry["size"]) for entry in written.files.values())
    typer.echo(
        f"{output}: {len(written.files)} files, {size / 1e6:.1f} MB, {output.stat().st_size / 1e6:.1f} MB packed"
    )
    for name in left_out:
        typer.echo(f"left out, as it is secret: {name}; --secrets includes it", err=True)
