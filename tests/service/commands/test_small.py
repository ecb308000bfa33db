"""Commands that say or prepare something."""

from importlib.metadata import version

import pytest
from typer.testing import CliRunner

from service.commands.exit_codes import EXIT_CODES
from service.commands.main import COMMANDS, app


def test_version() -> None:
    result = CliRunner().invoke(app, ["version"])
    assert (result.exit_code, result.stdout) == (0, f"axiswatch {version('axiswatch')}\n")


def test_warm_compiles_the_kernel() -> None:
    result = CliRunner().invoke(app, ["warm"])
    assert result.exit_code == 0
    assert result.stdout.startswith("the kernel is ready (")


@pytest.mark.parametrize("command", [[], *([c] for c in COMMANDS)], ids=lambda c: " ".join(c) or "axiswatch")
def test_help_tells_the_exit_codes(command: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    result = CliRunner().invoke(app, [*command, "--help"])
    assert result.exit_code == 0
    assert " ".join(EXIT_CODES.split()) in " ".join(result.stdout.split())
