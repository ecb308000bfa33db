"""`axiswatch history` against a daemon that stands still, over a real socket."""

import csv
import io
from collections.abc import Iterator
from pathlib import Path

import httpx
import pyarrow.parquet as pq
import pytest
from structlog.testing import capture_logs

from service.store.journal import Journal
from tests import golden
from tests.end_to_end.processes import PATIENCE_S
from tests.service.command_line import axiswatch, refused, session
from tests.service.web.conftest import Stage, serving, stored_history


@pytest.fixture
def url(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    journal = Journal(tmp_path / "alarms.sqlite")
    with (
        stored_history(tmp_path) as history,
        capture_logs(),
        serving(Stage(journal, history=history)) as address,
    ):
        monkeypatch.setenv("AXISWATCH_URL", address)
        yield address
    journal.close()


@pytest.mark.usefixtures("url")
def test_the_table_is_printed_or_written(tmp_path: Path) -> None:
    done = axiswatch("history", "demo.axis1", "--parameter", "fm")
    assert (done.exit_code, len(list(csv.DictReader(io.StringIO(done.stdout))))) == (0, 100)
    file = tmp_path / "fm.parquet"
    words = ("--since", "2026-03-01T11:00:00Z", "--until", "2026-03-01T11:59:00Z", "--resolution", "hour")
    done = axiswatch("history", "demo.axis1", *words, "-o", file)
    assert (done.exit_code, done.stdout) == (0, f"written: {file}\n")
    table = pq.read_table(file).to_pydict()
    assert table["parameter"] == ["kT", "1/Ja", "fm"]
    assert set(table["time"]) == {"2026-03-01T11:00:00.000000Z"}


@pytest.mark.usefixtures("url")
def test_a_full_disk_is_a_message(tmp_path: Path) -> None:
    file = tmp_path / "full.csv"
    file.symlink_to("/dev/full")
    message = refused("history", "demo.axis1", "-o", file)
    assert message == f"axiswatch: cannot write {file}: No space left on device"


def test_a_time_may_be_so_long_ago(url: str) -> None:
    done = axiswatch("history", "demo.axis1", "--parameter", "fm", "--since", "500y")
    address = f"{url}/api/v1/axes/demo.axis1/history.csv?parameter=fm"
    assert done.stdout == httpx.get(address, timeout=PATIENCE_S).text
    done = axiswatch("history", "demo.axis1", "--until", "500y")
    assert (done.exit_code, len(done.stdout.splitlines())) == (0, 1)


@pytest.mark.usefixtures("url")
def test_a_mistake_is_answered_with_what_is_wrong() -> None:
    text = session(
        "history",
        "demo.axis9",
        "demo.axis1 --since yesterday",
        "demo.axis1 --since 2026-03-01T12:00",
        "demo.axis1 --since 1h --until 2h",
        "demo.axis1 -o history.xlsx",
        "demo.axis1 -o nowhere/h.csv",
    )
    golden.check(text, Path(__file__).parent / "golden" / "history_mistakes.txt")
