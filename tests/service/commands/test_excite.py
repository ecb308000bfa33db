"""``axiswatch excite``: file, pictures and table; every mistake with what would be right."""

import csv
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from monitor_core.modeling.simulated_axis import SimulatedAxis
from service.commands.configuration import configuration
from service.commands.main import app
from service.config import drive_of, given_values
from service.config.resources import shipped

DEMO = shipped("demo.toml")
QUICK = ("--seconds", "2", "--seed", "3")


def excite(folder: Path, *arguments: str | Path, axis: str = "axis1", config: Path = DEMO) -> Result:
    line = ["excite", "--config", config, "--axis", axis, "-o", folder / "e.csv", *arguments]
    return CliRunner().invoke(app, [str(word) for word in line])


def columns(file: Path) -> dict[str, np.ndarray]:
    with file.open(encoding="utf-8") as rows:
        read = list(csv.DictReader(rows))
    return {name: np.array([float(row[name]) for row in read]) for name in read[0]}


def test_the_file_is_what_the_drive_does_within_the_limits(tmp_path: Path) -> None:
    result = excite(tmp_path, *QUICK, "--torque-limit", "2", "--speed-limit", "15", "--periods", "3")
    assert result.exit_code == 0, result.output
    c = columns(tmp_path / "e.csv")
    assert list(c) == ["t_s", "torque_Nm", "speed_rad_s", "angle_rad"]
    assert c["t_s"] == pytest.approx(np.arange(400 * 4 + 200) * 0.005)
    assert np.abs(c["torque_Nm"]).max() <= 2
    assert np.abs(c["speed_rad_s"]).max() <= 15
    config = configuration(DEMO).axes[0].config
    axis = SimulatedAxis(given_values(config), 1.0, drive=drive_of(config, "angle"))
    motion = [(0.0, 0.0), *(axis.step(u, 0.005) for u in c["torque_Nm"][:-1])]
    assert c["angle_rad"] == pytest.approx(np.array(motion)[:, 0], abs=1e-4)
    assert c["speed_rad_s"] == pytest.approx(np.array(motion)[:, 1], abs=1e-4)


def test_the_table(tmp_path: Path) -> None:
    text = excite(tmp_path, *QUICK, "--torque-limit", "2").stdout
    assert re.search(r"demo\.axis1: 1400 samples, 7 s: 2 s to warm up, 2 periods of 2 s", text)
    assert re.search(r"torque +[\d.]+ N m +2 N m +99\.\d % +binds", text)
    assert re.search(r"speed +[\d.]+ rad/s +none", text)
    crest, random = re.findall(r"crest factor ([\d.]+) \(random phases ([\d.]+)", text)[0]
    assert float(crest) < 1.55 < float(random)
    assert all(re.search(rf"^{name} +[\d.]+ %", text, re.M) for name in ("Jm", "ka", "fm", "fc"))
    assert "held at their nominal values: kT, r" in text
    assert "flat" not in text


def test_a_spectrum_for_what_is_to_be_found(tmp_path: Path) -> None:
    result = excite(tmp_path, *QUICK, "--torque-limit", "2", "--find", "1/Ja, fm")
    assert result.exit_code == 0, result.output
    assert "with a flat spectrum" in result.stdout
    gains = re.search(r"as a flat one: 1/Ja (\d+\.?\d*), fm (\d+\.?\d*)", " ".join(result.stdout.split()))
    assert gains is not None
    assert max(map(float, gains.groups())) > 1.1


@pytest.mark.parametrize("quantity", ["speed", "angle"])
def test_a_reference_is_a_column_more(tmp_path: Path, quantity: str) -> None:
    result = excite(tmp_path, *QUICK, "--torque-limit", "2", "--as", quantity)
    assert result.exit_code == 0, result.output
    c = columns(tmp_path / "e.csv")
    name = {"speed": "speed_reference_rad_s", "angle": "angle_reference_rad"}[quantity]
    predicted = c[{"speed": "speed_rad_s", "angle": "angle_rad"}[quantity]]
    assert list(c)[-1] == name
    assert c[name] == pytest.approx(predicted, abs=0.2 * np.abs(predicted).max())


def test_pictures(tmp_path: Path) -> None:
    svg, png = tmp_path / "e.svg", tmp_path / "e.png"
    result = excite(tmp_path, *QUICK, "--torque-limit", "2", "--svg", svg, "--png", png, "--find", "fm")
    assert result.exit_code == 0, result.output
    assert ET.fromstring(svg.read_bytes()).tag.endswith("svg")
    assert png.read_bytes().startswith(b"\x89PNG")


def test_a_seed_repeats_the_phases(tmp_path: Path) -> None:
    files = []
    for seed in ("1", "1", "2"):
        assert excite(tmp_path, "--seconds", "2", "--torque-limit", "2", "--seed", seed).exit_code == 0
        files.append((tmp_path / "e.csv").read_bytes())
    assert files[0] == files[1] != files[2]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "no limit is given"),
        (("--torque-limit", "-1"), "torque limit -1"),
        (("--torque-limit", "2", "--band", "30"), "LOW:HIGH"),
        (("--torque-limit", "2", "--band", "30:1"), "0 <= low < high"),
        (("--torque-limit", "2", "--band", "0:100"), "200 samples a second reach to below 100 Hz"),
        (("--torque-limit", "2", "--band", "0.01:0.02"), "widen the band or lengthen the period"),
        (("--torque-limit", "2", "--seconds", "0.01"), "at least 16 samples"),
        (("--torque-limit", "2", "--seconds", "nan"), "at least 16 samples"),
        (("--torque-limit", "2", "--seconds", "1e9"), "ask for less"),
        (("--torque-limit", "2", "--find", "jm"), 'did you mean "Jm"'),
        (("--torque-limit", "2", "--find", "Ja,1/Ja"), "named twice"),
        (("--torque-limit", "2", "--free", "Ja", "--find", "fm"), "among the free parameters"),
        (("--torque-limit", "0.005"), "torque limit does not hold"),
        (("--torque-limit", "2", "--kp", "1"), "--kp and --kd go together"),
        (("--torque-limit", "2", "--kp", "1", "--kd", "1"), "leave them out"),
        (("--torque-limit", "2", "--as", "angle", "--kp", "1e9", "--kd", "1"), "not stable with kp"),
        (("--torque-limit", "2", "-o", "no/such/folder.csv"), "cannot write no/such/folder.csv"),
        (("--torque-limit", "2", "--svg", "x.svg", "--png", "x.svg"), "the same"),
    ],
)
def test_mistakes(tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    result = excite(tmp_path, *QUICK, *arguments)
    said = re.sub(r"[\s│]+", " ", result.output)
    assert (result.exit_code, message in said) == (2, True), result.output
    assert "Traceback" not in result.output


def test_axes_are_named(tmp_path: Path) -> None:
    result = excite(tmp_path, "--torque-limit", "2", axis="axis9")
    assert (result.exit_code, "axis9 is not there" in result.output) == (2, True)


def test_other_commands_start_without_matplotlib() -> None:
    code = (
        "import sys; import service.commands.main, service.commands.run, service.commands.excite;"
        " sys.exit('matplotlib' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
