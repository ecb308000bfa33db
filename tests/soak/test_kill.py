"""kill -9 fifty times while alarms are raised, and as often while the daemon starts."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.end_to_end.test_daemon import killed

pytestmark = pytest.mark.soak


def test_no_shown_alarm_is_lost(tmp_path: Path, seed: int) -> None:
    shown = killed(tmp_path, seed, kills=50, fault_after_s=20, while_starting=True)
    assert any(alarm["parameter"] == "fm" for alarm in shown.values())
