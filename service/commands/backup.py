"""``axiswatch backup``: configuration and state in one file, while the daemon runs."""

import os
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import tomlkit
import typer

from service.commands.command_line.exit_codes import explained
from service.commands.command_line.options import ConfigPath, Force, configuration
from service.commands.command_line.output_files import check_new
from service.config.schema import SECRET_FILES, Config
from service.config.written.commissioning_files import REPORT, pages_of
from service.config.written.named_files import found_files, kept_files
from service.texts.instants import iso, now_us

Output = Annotated[
    Path,
    typer.Option("--output", "-o", metavar="FILE", help="The archive, a .tar.gz that only its owner can read."),
]
Secrets = Annotated[
    bool,
    typer.Option("--secrets", help="With the tokens of the API, the private key of TLS and the secrets of links."),
]
WithoutState = Annotated[
    bool,
    typer.Option(
        "--without-state", help="Only the configuration and its files, as before the first run of the daemon."
    ),
]


def backup(
    config: ConfigPath,
    output: Output,
    secrets: Secrets = False,
    without_state: WithoutState = False,
    force: Force = False,
) -> None:
    """Save configuration and state in one archive; the daemon can keep running.

    The archive holds the configuration and every file that it names, the report of its commissioning, and the state
    directory: alarms and what was done about them, checkpoints, history; each database as it is at one moment.
    Recordings of frames are left out, and so are secrets without --secrets. `axiswatch restore` unpacks it.
    """
    from service.store.archive import FORMAT, Manifest, state_files, write_archive
    from service.store.tokens import TOKENS_FILE

    read = configuration(config, without_bus=True)
    check_new(output, force)
    with explained(OSError):
        found = bundle(config, read)
        kept = {} if without_state else state_files(read.service.state_dir)
        state = {f"{found.state}/{name}": file for name, file in kept.items()}
        files = found.files | state
        secret = {*found.secrets, f"{found.state}/{TOKENS_FILE}"} & files.keys()
        left_out = [] if secrets else sorted(secret)
        sources: dict[str, Path | bytes] = {
            found.name: found.text.encode(),
            **{name: file for name, file in files.items() if name not in left_out},
        }
        manifest = Manifest(FORMAT, version("axiswatch"), iso(now_us()), found.name, found.renamed, left_out, {})
        written = write_archive(output, manifest, sources)
    size = sum(int(entry["size"]) for entry in written.files.values())
    typer.echo(
        f"{output}: {len(written.files)} files, {size / 1e6:.1f} MB, {output.stat().st_size / 1e6:.1f} MB packed"
    )
    for name in left_out:
        typer.echo(f"left out, as it is secret: {name}; --secrets includes it", err=True)


# --- A configuration with all files that it names, as they lie in one folder ------------------------------------------


OUTSIDE = "outside"
"""Folder in the archive for files outside the folder of the configuration"""
STATE = "state"


class Bundle(NamedTuple):
    """The files of a configuration; names are relative to the folder of the bundle, with "/"."""

    name: str
    """Name of the configuration file"""
    text: str
    """Text of the configuration; names of files outside its folder are replaced in it"""
    files: dict[str, Path]
    """Present path of each other file, by its name in the bundle"""
    secrets: frozenset[str]
    """Names of the secret files: the private key of TLS, passwords and keys of links"""
    state: str
    """The state directory"""
    renamed: dict[str, str]
    """Files and folders outside the folder of the configuration, and their names in the bundle"""


def bundle(file: Path, config: Config) -> Bundle:
    """The files of a configuration; their names stay as they are where that is possible.

    ``config``: contents of the file, with the values of the environment.

    Raises:
        OSError: it cannot be read.
    """
    folder = file.absolute().parent
    document = tomlkit.parse(file.read_text(encoding="utf-8-sig"))
    files, secrets, renamed = dict[str, Path](), set[str](), dict[str, str]()
    for table, key in (*kept_files(document), *found_files(document)):
        given = str(table[key])
        source = folder / given
        if (name := _inside(source, folder)) is None:
            name = renamed.setdefault(given, f"{OUTSIDE}/{len(renamed) + 1}-{source.name}")
            table[key] = name
        files[name] = source
        if key in ("key", *SECRET_FILES):
            secrets.add(name)
    state = _inside(config.service.state_dir, folder)
    if state is None:
        renamed[str(config.service.state_dir)] = state = STATE
    service: Any = document.setdefault("service", tomlkit.table())
    if STATE in renamed.values() or service.get("state_dir", STATE) != state:
        service["state_dir"] = state  # that of systemd, or of the environment, may be another one then
    reports = (REPORT, *(page for axis in config.axes for page in pages_of(axis.id)))
    files |= {name: folder / name for name in reports if (folder / name).is_file()}
    return Bundle(file.name, tomlkit.dumps(document), files, frozenset(secrets), state, renamed)


def _inside(path: Path, folder: Path) -> str | None:
    """The name of a path relative to the folder; None: the path lies outside."""
    name = os.path.relpath(path, folder)
    return None if name == "." or name.startswith("..") else Path(name).as_posix()
