"""Where commands run."""

from pathlib import Path

import pytest

from tests.service.commands.commissioning.two_mass_tables import table


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder in which commands run."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def record(folder: Path, seed: int) -> Path:
    """A table of two axes with names: Time, A1_Trq, A1_Pos, A2_Trq, A2_Pos."""
    return table(folder / "record.csv", seed, 20.0, axes=2)
