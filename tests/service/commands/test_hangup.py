"""What SIGHUP does to a daemon that runs, and to one that is still starting."""

from collections.abc import Sequence
from pathlib import Path
from typing import cast

import pytest
from structlog.testing import capture_logs

from service.commands.run import Hangup
from service.config import Config
from service.pipeline.reconfiguration.reloading import Reloaded, ReloadError, Reloading
from tests.end_to_end.processes import demo_config, edit, wait_for


class Applied:
    """Notes what it is given, in the place of the object that applies a configuration."""

    def __init__(self) -> None:
        self.configs, self.refused = list[Config](), list[Sequence[str]]()
        self.fault: str | None = None

    def reload(self, new: Config) -> Reloaded:
        if self.fault is not None:
            raise ReloadError(self.fault)
        self.configs.append(new)
        return Reloaded((), (), (), len(new.axes), ())

    def refuse(self, _file: Path, problems: Sequence[str]) -> None:
        self.refused.append(problems)


@pytest.mark.parametrize("mistaken", [False, True])
def test_while_the_daemon_starts_it_is_noted_and_applied_once_it_runs(tmp_path: Path, mistaken: bool) -> None:
    file, applied = demo_config(tmp_path), Applied()
    hangup = Hangup(file, 8123)
    with capture_logs() as logs:
        hangup.apply()
    assert [entry["event"] for entry in logs] == ["SIGHUP: the configuration is read again once the daemon has started"]
    # The file as it is then counts.
    change = ("[[bus]]", "[[bsu]]") if mistaken else ("sample_interval_s = 0.005", "sample_interval_s = 0.02")
    edit(file, change)
    hangup.start(cast(Reloading, applied))
    wait_for(lambda: applied.configs or applied.refused)
    if mistaken:
        assert (applied.configs, "bsu" in applied.refused[0][0]) == ([], True)
    else:
        (config,) = applied.configs
        assert (config.axes[0].config.sample_interval_s, config.web.port) == (0.02, 8123)


def test_without_it_nothing_is_applied_at_the_start(tmp_path: Path) -> None:
    applied = Applied()
    hangup = Hangup(demo_config(tmp_path), None)
    hangup.start(cast(Reloading, applied))
    assert applied.configs == []
    hangup.apply()
    assert len(applied.configs) == 1


def test_the_log_names_the_folder_of_a_file_and_the_operator_sees_its_name(tmp_path: Path) -> None:
    file, applied = demo_config(tmp_path), Applied()
    applied.fault = f"{tmp_path / 'tls' / 'cell.crt'}: No such file or directory"
    hangup = Hangup(file, None)
    hangup.start(cast(Reloading, applied))
    with capture_logs() as logs:
        hangup.apply()
    assert logs[-1]["reason"] == applied.fault
    assert applied.refused == [["tls/cell.crt: No such file or directory"]]
