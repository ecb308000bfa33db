"""Tables of results as text."""

from __future__ import annotations

import pytest

from service.commands.command_line.output_files import table_console
from service.reports.formats import TextTable, for_terminal

_TABLE = TextTable(
    ("axis", "parameter", "size ± sd", "onset", "raised", "ended"),
    [("robot1.axis1", "torque offset", "+0.354 ± 0.049 N m (+354 %)", *["1062720.37 s"] * 3)],
)


@pytest.mark.parametrize("columns", ["", "60"])
def test_no_digit_is_cut_off(columns: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Nor are numbers broken in a file, which is as wide as it needs to be."""
    monkeypatch.delenv("COLUMNS", raising=False)
    if columns:
        monkeypatch.setenv("COLUMNS", columns)
    table_console().print(for_terminal(_TABLE, "Alarms"))
    text = capsys.readouterr().out
    assert "…" not in text
    assert columns or text.count("1062720.37 s") == 3
