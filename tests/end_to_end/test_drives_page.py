"""The page on drives that no robot's DBC describes: its commands and texts, from the file to live values."""

from __future__ import annotations

import itertools
import math
import shutil
from pathlib import Path

import pytest

from service.can.frames import Frame
from service.config import load
from service.ingest.samples.bus_samples import Ingest
from tests.conftest import ROOT
from tests.end_to_end.documents import TOML, shown
from tests.service.command_line import axiswatch, refused
from tests.service.commands.commissioning.two_mass_tables import table
from tests.service.commands.live_robots import moving
from tests.service.ingest.plant import fed

_CHANNELS = itertools.count()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory, seed: int) -> Path:
    return table(tmp_path_factory.mktemp("rows") / "rows.csv", seed, 16.0, axes=2)


def init(file: str) -> None:
    (command,) = (words for words in shown("axiswatch init") if words[2] == file)
    done = axiswatch(*command[1:])
    assert done.exit_code == 0, done.output


def on_a_bus_here(file: Path) -> Path:
    """The configuration with a bus inside this process."""
    bus = f'interface = "virtual"\nchannel = "page-{next(_CHANNELS)}"\noptions = {{ preserve_timestamps = true }}'
    text = file.read_text(encoding="utf-8")
    assert 'channel = "can0"' in text
    file.write_text(text.replace('channel = "can0"', bus), encoding="utf-8")
    return file


def heard(rows: Path, config: Path) -> str:
    """What `check` accepts and `listen` shows."""
    (check,) = (words for words in shown("axiswatch check") if "axis.toml" in words)
    (listen,) = (words for words in shown("axiswatch listen") if "axis.toml" in words)
    assert axiswatch(*check[1:]).exit_code == 0
    with moving(rows, config):
        done = axiswatch(*listen[1:])
    assert done.exit_code == 0, done.output
    return done.stdout


def block(words: str) -> str:
    """The text of the page that holds these words."""
    (found,) = (text for text in TOML if words in text)
    return found


def test_canopen_drives(folder: Path, rows: Path) -> None:
    shutil.copy(ROOT / "config" / "drive.eds", folder)
    init("drive.eds")
    assert "rated_torque_Nm: missing" in refused("check", "--config", "axis.toml")
    file = folder / "axis.toml"
    before, _, after = file.read_text(encoding="utf-8").partition("[robot.defaults.canopen]\n")
    axes = after[after.index("[[robot.axis]]") :]
    file.write_text(before + block("rated_torque_Nm") + "\n" + axes, encoding="utf-8")
    with file.open("a", encoding="utf-8") as opened:  # of the last axis; nothing follows it yet
        opened.write('signal = [{ name = "temperature", signal = "0x2030.1" }]\n')
    found = heard(rows, on_a_bus_here(file))
    for words in (
        "axis1\ttorque",
        "axis2\tangle",
        "node3.0x6077",
        "node4.0x6064",
        "axis2\tsignal temperature",
    ):
        assert words in found
    bus = load(file, {}).bus[0]
    where = f"{bus.interface}:{bus.channel},preserve_timestamps=true"
    with moving(rows, file):  # the drives are found by what they send
        done = axiswatch("init", "drive.eds", "--bus", where, "--seconds", 1, "-o", "found.toml")
    assert "node 3: torque 0x6077, position 0x6064\nnode 4:" in done.stdout, done.output
    assert f'channel = "{bus.channel}"' in Path("found.toml").read_text(encoding="utf-8")


def test_an_odrive(folder: Path, rows: Path, records_dir: Path) -> None:
    shutil.copy(records_dir / "can" / "odrive-cansimple.dbc", folder)
    init("odrive-cansimple.dbc")
    file = folder / "axis.toml"
    before, *_ = file.read_text(encoding="utf-8").partition("[[robot.axis]]")
    file.write_text(before + block("Axis0_Get_Iq"), encoding="utf-8")
    found = heard(rows, on_a_bus_here(file))
    assert "Axis0_Get_Iq.Iq_Measured" in found
    (axis,) = load(file, {}).axes
    assert axis.config.torque.scale == (0.083, 0.0)
    assert axis.config.motion.factor == pytest.approx(2 * math.pi)


def test_a_table_of_ids(folder: Path) -> None:
    file = folder / "axis.toml"
    file.write_text(block("[[bus.message]]"), encoding="utf-8")
    config = load(file, {})
    data = (-250).to_bytes(2, "little", signed=True) + (65536 // 4).to_bytes(4, "little")
    ingest = Ingest(config, "can0")
    (sample,) = fed(ingest, [Frame(0, 0x181, False, data)])["cell1.axis1"]
    assert sample.torque == pytest.approx(2.5 * 0.13)
    assert sample.motion == pytest.approx(math.pi / 2)
