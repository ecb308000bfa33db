"""The dashboard as built: its size, its lock file; the tests of its data layer, by npm."""

import gzip
import json
from pathlib import Path

import pytest

from hatch_build import is_current, npm
from service.web.app import STATIC

DASHBOARD = STATIC.with_name("dashboard")
LARGEST_BYTES = 80_000


@pytest.fixture(scope="module")
def files() -> list[Path]:
    assert (STATIC / "index.html").is_file(), "not built: python hatch_build.py"
    return sorted(STATIC.iterdir())


def test_it_is_small(files: list[Path]) -> None:
    """All of it, as a server that compresses would send it."""
    assert sum(len(gzip.compress(file.read_bytes())) for file in files) <= LARGEST_BYTES


def test_it_is_newer_than_its_sources() -> None:
    """Else the tests of the page would test another one; `make` builds it by itself."""
    assert is_current(), "python hatch_build.py"


def test_the_lock_file_has_hashes_and_no_host() -> None:
    packages = json.loads((DASHBOARD / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    assert [name for name, p in packages.items() if name and "integrity" not in p] == []
    assert [name for name, p in packages.items() if "resolved" in p] == []


def test_its_data_layer() -> None:
    npm("test", "--silent")  # with what npm writes, if one fails
