"""Before frames are sent where a drive may listen, a person is asked."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import typer

from service.can.bus import reaches_hardware
from service.commands.command_line.exit_codes import MISTAKE
from service.commands.command_line.options import confirm_sending
from tests.end_to_end.processes import demo_config
from tests.service.command_line import axiswatch


def bus(interface: str, channel: str) -> Any:
    return SimpleNamespace(name="b", interface=interface, channel=channel, queue_frames=1000, options={})


@pytest.mark.parametrize(
    ("interface", "channel", "real"),
    [
        ("virtual", "axiswatch-demo", False),
        ("udp_multicast", "239.1.2.3", False),
        ("socketcan", "vcan0", False),
        ("socketcan", "vxcan1", False),
        ("socketcan", "can0", True),
        ("socketcan", "slcan0", True),
        ("socketcan", "vcan_line3", True),
        ("pcan", "PCAN_USBBUS1", True),
        ("slcan", "/dev/ttyACM0", True),
    ],
)
def test_what_is_not_known_to_be_virtual_is_real(interface: str, channel: str, real: bool, tmp_path: Path) -> None:
    assert reaches_hardware(bus(interface, channel), tmp_path) == real


def test_an_adapter_that_was_given_a_virtual_name_is_real(tmp_path: Path) -> None:
    (tmp_path / "vcan0" / "device").mkdir(parents=True)
    assert reaches_hardware(bus("socketcan", "vcan0"), tmp_path)


@pytest.fixture
def real(tmp_path: Path) -> Path:
    return demo_config(tmp_path, 'interface = "socketcan"\nchannel = "can9"', axes=1)


@pytest.mark.parametrize("command", ["simulate", "play"])
def test_a_script_needs_yes(command: str, real: Path, tmp_path: Path) -> None:
    words = ("play", tmp_path / "not-read.log") if command == "play" else ("simulate", "--seconds", "0.01")
    refused = axiswatch(*words, "--config", real)
    assert refused.exit_code == MISTAKE
    assert "this sends frames on socketcan can9: a drive or controller" in refused.stderr
    assert "--yes" in refused.stderr


@pytest.mark.parametrize("answer", [True, False])
def test_on_a_terminal_the_person_decides(answer: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = list[str]()

    def confirm(question: str, default: bool) -> bool:
        asked.append(question)
        assert not default
        return answer

    monkeypatch.setattr(sys, "stdin", SimpleNamespace(isatty=lambda: True))
    monkeypatch.setattr(typer, "confirm", confirm)
    confirm_sending([bus("virtual", "a")], yes=False)
    assert asked == []
    if answer:
        confirm_sending([bus("socketcan", "can0")], yes=False)
    else:
        with pytest.raises(typer.Exit) as end:
            confirm_sending([bus("socketcan", "can0")], yes=False)
        assert end.value.exit_code == MISTAKE
    assert asked == ["Send?"]
