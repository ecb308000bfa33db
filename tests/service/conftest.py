"""The files of a daemon's state, in a folder of the test."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from service.store.checkpoints import Checkpoints
from service.store.journal import Journal


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[Journal]:
    journal = Journal(tmp_path / "alarms.sqlite")
    yield journal
    journal.close()


@pytest.fixture
def checkpoints(tmp_path: Path) -> Iterator[Checkpoints]:
    checkpoints = Checkpoints(tmp_path / "checkpoints.sqlite")
    yield checkpoints
    checkpoints.close()
