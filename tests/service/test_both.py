"""Angle and speed of an axis: from the configuration, over frames and tables, to the estimates."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from monitor_core.drive.kalman import filter_gain, gains_of_both
from service.can.encode import FrameEncoder
from service.can.user_errors import IngestError
from service.commands.main import app
from service.config import Config, ConfigErrors, load
from service.config.axis_settings import axis_model, axis_settings
from service.ingest.assemble import Assembler
from service.pipeline.frame_pipeline import Core
from service.simulation.robot import Fault, SimulatedRobot
from tests.service.identification.nominal_texts import nominal_text
from tests.service.pipeline.robots import blocks
from tests.service.test_skew import WATCHED as DELAY_TOO
from tests.service.test_skew import replayed, written

H, FAULT_S, END_S, START_S = 0.005, 14.0, 20.0, 1_760_000_000
WATCHED = 'monitor = ["kT", "1/Ja", "fm"]'
NOISE = ("output_noise = 0.0001", "output_noise = 0.0001\nspeed_noise = 0.02")
PLACE = '[robot.axis.speed]\nmessage = "Axis1Angle"\nsignal = "Speed"\ncolumn = "w"\n\n[robot.axis.time]'
IN_FRAME = ' SG_ Speed : 48|16@1- (0.02,0) [-655.36|655.34] "rad/s" Monitor\n'
CONFIG = Path(__file__).resolve().parents[2] / "config"


def configured(folder: Path, *changes: tuple[str, str], beside: str = PLACE, noise: str = NOISE[1]) -> Path:
    """The demo's first axis with frames of its own for torque and angle, and the speed in that of the angle."""
    folder.mkdir(exist_ok=True)
    file = written(folder, ("[robot.axis.time]", beside), (NOISE[0], noise), *changes, monitor=WATCHED)
    before, torque, after = file.read_text(encoding="utf-8").partition("Axis1State")
    text = before + "Axis1Torque" + after.replace("Axis1State", "Axis1Angle")
    assert torque
    file.write_text(text, encoding="utf-8")
    (folder / "demo.dbc").write_bytes((CONFIG / "robot.dbc").read_bytes())
    return file


def problems(file: Path) -> str:
    with pytest.raises(ConfigErrors) as caught:
        load(file, {})
    return str(caught.value)


def test_both_make_one_filter(tmp_path: Path) -> None:
    axis = load(configured(tmp_path), {}).axes[0]
    model = axis_model(axis.config)
    settings = axis_settings(axis, model)
    assert model.drive.both
    assert model.drive.output == axis.config.output == "angle"
    g = gains_of_both(model, H, axis.config.estimator.torque_noise or 0, 1e-4, 0.02)
    assert (settings.K, settings.lam0, settings.K_after, settings.second) == g
    larger = NOISE[1] + f"\ninnovation_variance = {4 * g.lam0!r}"
    axis = load(configured(tmp_path / "b", noise=larger), {}).axes[0]
    scaled = axis_settings(axis, model).second
    assert scaled is not None
    assert g.second is not None
    assert scaled.lam0 == pytest.approx(4 * g.second.lam0)


def test_the_noise_of_the_speed_may_follow_from_its_resolution(tmp_path: Path) -> None:
    steps = PLACE.replace('column = "w"', 'column = "w"\nresolution = 0.1')
    axis = load(configured(tmp_path, beside=steps, noise=NOISE[0]), {}).axes[0]
    model = axis_model(axis.config)
    assert (
        axis_settings(axis, model).second == gains_of_both(model, H, 0.05, 1e-4, 0.1 / math.sqrt(12)).second
    )


@pytest.mark.parametrize(
    ("beside", "noise", "words"),
    [
        (PLACE, NOISE[0], "speed_noise: missing: with angle and speed the gains need it"),
        (PLACE.replace("Axis1Angle", "Axis2Angle"), NOISE[1], "same sample: Axis1Angle or Axis1Torque"),
        (
            PLACE.replace('"w"', '"w"\naveraged = true'),
            NOISE[1],
            "is the difference of two angles, and tells no more",
        ),
        ("[robot.axis.time]", NOISE[1], "speed_noise = 0.02: is that of a speed beside an angle"),
        (PLACE, NOISE[1] + "\ngain = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]", "is that of one output"),
    ],
)
def test_mistakes_are_named(beside: str, noise: str, words: str, tmp_path: Path) -> None:
    found = problems(configured(tmp_path, beside=beside, noise=noise))
    assert words in found
    assert "problems" not in found or found.count("\n") < 3


def test_check_says_what_is_used(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["check", "--config", str(configured(tmp_path))])
    assert result.exit_code == 0, result.output
    assert "Axis1Angle.Angle (angle)" in result.output
    assert "Axis1Angle.Speed (speed)" in result.output


def test_nominal_values_found_with_the_angle(tmp_path: Path) -> None:
    """Their noises make the gains of both; how much larger than these say errors were is kept."""
    file = configured(tmp_path)
    axis = load(file, {}).axes[0]
    (tmp_path / "nominal.toml").write_text(nominal_text(axis.config.with_one_output), encoding="utf-8")
    text = file.read_text(encoding="utf-8")
    named = text.replace(WATCHED, f'{WATCHED}\nnominal_file = "nominal.toml"')
    kept = [line for line in named.splitlines() if not line.startswith(("torque_noise", "output_noise"))]
    file.write_text("\n".join(kept), encoding="utf-8")
    axis = load(file, {}).axes[0]
    model = axis_model(axis.config)
    settings = axis_settings(axis, model)
    g = gains_of_both(model, H, 0.05, 1e-4, 0.02)
    assert settings.K == g.K
    expected = filter_gain(model, H, 0.05, 1e-4)[1]
    one = axis_settings(
        axis._replace(config=axis.config.with_one_output), axis_model(axis.config.with_one_output)
    )
    assert settings.lam0 / g.lam0 == pytest.approx(one.lam0 / expected)
    result = CliRunner().invoke(app, ["check", "--config", str(file)])
    assert "were found with the angle by itself" in result.output


def moments(config: Config, seed: int) -> list[tuple[float, tuple[float, ...]]]:
    found: list[tuple[float, tuple[float, ...]]] = []
    for moment in SimulatedRobot(config, seed, [Fault("demo.axis1", {"kT": 0.8}, FAULT_S)]).moments():
        if moment.time_s > END_S:
            return found
        u, phi, _, w = moment.readings["demo.axis1"]
        found.append((moment.time_s, (u, phi, w)))
    raise AssertionError


def test_a_table_with_both_is_replayed(tmp_path: Path, seed: int) -> None:
    """Its fault is found; missing speeds are counted; without the column of the speed it is used as it is."""
    file, rng = configured(tmp_path), np.random.default_rng(seed)
    rows = ["t,u,phi,w"]
    for t, (u, phi, w) in moments(load(file, {}), seed):
        shown = "" if rng.random() < 0.1 else "1e30" if rng.random() < 0.01 else repr(w)
        rows.append(f"{START_S + t:.6f},{u!r},{phi!r},{shown}")
    (tmp_path / "both.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (axis,) = json.loads(replayed(file, str(tmp_path / "both.csv"), "--json", "-"))["axes"]
    assert "kT" in {alarm["parameter"] for alarm in axis["alarms"]}
    absurd = sum(row.endswith("e30") for row in rows)
    missing = sum(row.endswith(",") for row in rows) + absurd
    assert axis["dropped"]["absurd"] == absurd > 0
    # The first sample starts the predictor; an empty cell in it is not counted.
    assert missing - 1 <= axis["counters"]["second_missing"] <= missing
    assert axis["counters"]["used"] + axis["counters"]["seeding"] > 3000
    blind = configured(tmp_path / "b", beside=PLACE.replace('column = "w"\n', ""))
    (axis,) = json.loads(replayed(blind, str(tmp_path / "both.csv"), "--json", "-"))["axes"]
    assert axis["counters"]["second_missing"] == len(rows) - 2
    played = CliRunner().invoke(
        app, ["play", "--config", str(file), "--speed", "1e9", str(tmp_path / "both.csv")]
    )
    assert played.exit_code == 2
    assert "the speed is missing, and its frame cannot leave it out" in " ".join(played.output.split())


def test_frames_carry_both(tmp_path: Path, seed: int) -> None:
    """Through frames and decoding the estimates are those of the samples, but for the steps of the signals."""
    config = load(configured(tmp_path), {})
    core = Core(config)
    for block in blocks(config, 6.0, seed):
        core.take(config.bus[0].name, block)
        core.run()
    monitor = core.monitors.by_id["demo.axis1"]
    counters = monitor.facts().counters
    assert counters["second_missing"] == counters["second_outlier"] == 0
    assert counters["seeding"] > 200
    speed = monitor.bank.state.running2[0, 0] / monitor.settings.lam0
    assert 0.5 < speed < 1.5  # its innovations are as large as its noise and that of the torque make them


@pytest.mark.parametrize("carrier", ["torque", "motion"])
def test_the_speed_goes_with_its_frame(carrier: str) -> None:
    assembler = Assembler(H, 0.4 * H, 10 * H)
    seconds = {"torque": math.nan, "motion": math.nan} | {carrier: 3.0}
    assert assembler.add("motion", 1000, 1.0, second=seconds["motion"]) is None
    sample = assembler.add("torque", 1100, 2.0, second=seconds["torque"])
    assert sample is not None
    assert (sample.torque, sample.motion, sample.second) == (2.0, 1.0, 3.0)
    pair = assembler.add_pair(6000, 2.0, 1.0, None, 4.0)
    assert pair is not None
    assert pair.second == 4.0
    absurd = assembler.add_pair(11_000, 2.0, 1.0, None, 1e30)
    assert absurd is not None
    assert math.isnan(absurd.second)
    assert assembler.dropped["absurd"] == 1


def test_the_speed_may_be_in_the_frame_of_the_torque(tmp_path: Path, seed: int) -> None:
    file = configured(tmp_path, beside=PLACE.replace("Axis1Angle", "Axis1Torque"))
    dbc = tmp_path / "demo.dbc"
    message = "Axis1Torque: 8 Controller\n"
    dbc.write_text(dbc.read_text(encoding="utf-8").replace(message, message + IN_FRAME), encoding="utf-8")
    config = load(file, {})
    core = Core(config)
    for block in blocks(config, 1.0, seed):
        core.take(config.bus[0].name, block)
    core.run()
    assert core.monitors.by_id["demo.axis1"].facts().counters["second_missing"] == 0


def test_a_frame_cannot_be_made_without_it(tmp_path: Path) -> None:
    config = load(configured(tmp_path), {})
    encoder = FrameEncoder(config, config.bus[0].name)
    with pytest.raises(IngestError, match=r"axis demo\.axis1: the speed is missing"):
        encoder.encode({"demo.axis1": (0.0, 0.0)}, 0)


def test_with_the_delay_watched(tmp_path: Path) -> None:
    axis = load(configured(tmp_path, (WATCHED, DELAY_TOO)), {}).axes[0]
    assert axis_model(axis.config).drive.both
    assert axis_model(axis.config).monitored[-1] == "delay"
