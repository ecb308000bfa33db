"""Where axes are commissioned, and with what haste."""

from pathlib import Path

import pytest

from service.commands import commission
from tests.service.commands.commissioning.two_mass_tables import FEW


@pytest.fixture
def folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder in which commands run; calibrations are short."""
    monkeypatch.setattr(commission, "options_for", lambda _budget_s: FEW)
    return folder
