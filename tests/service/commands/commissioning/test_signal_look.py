"""A look at the signals of an axis while the daemon runs: what its last frames show, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from service.can.frames import FrameBlock
from service.commands.commissioning.live.signal_look import SignalLook
from service.config import Config
from service.pipeline.persistence.recording import Extracts
from service.pipeline.persistence.recording_folder import RecordingFolder
from service.web.robot_setup import NoLookError, SignalCheck
from tests.service.pipeline.robots import START_US, blocks, changed, demo, with_axes
from tests.service.pipeline.ticking_extracts import ticking

Robot = tuple[Config, list[FrameBlock]]
"""A configuration, and the frames that it sends"""
SECONDS = 6.0
NOW_US = START_US + round(SECONDS * 1e6)


@contextmanager
def kept(folder: Path, frames: Iterable[FrameBlock], bus: str = "can0") -> Iterator[Extracts]:
    """Frames that the daemon keeps, and its worker, which hands them over."""
    extracts = Extracts(RecordingFolder(folder, 10**6), 20.0, 5.0, lambda: NOW_US)
    for block in frames:
        extracts.add(bus, block)
    with closing(extracts), ticking(extracts):
        yield extracts


def looked_at(
    folder: Path, config: Config, sent: Iterable[FrameBlock], axis: str = "demo.axis2", now_us: int = NOW_US
) -> SignalCheck:
    with kept(folder, sent) as extracts:
        return SignalLook(lambda: config, extracts, lambda: now_us)(axis)


@pytest.fixture(scope="module")
def healthy(tmp_path_factory: pytest.TempPathFactory, seed: int) -> Robot:
    config = demo(tmp_path_factory.mktemp("state"))
    return config, list(blocks(config, SECONDS, seed))


def test_a_healthy_axis(tmp_path: Path, healthy: Robot) -> None:
    found = looked_at(tmp_path, *healthy)
    assert (found.problems, found.proposals) == ([], [])
    assert found.moves is True
    assert found.missing == 0
    assert found.rate_hz == pytest.approx(200, rel=1e-3)
    assert found.seconds == pytest.approx(SECONDS, abs=0.02)
    torque, angle = found.signals
    assert (torque.signal, torque.unit) == ("Axis2State.Torque", "N m")
    assert (angle.signal, angle.unit) == ("Axis2State.Angle", "rad")
    for signal in (torque, angle):
        assert signal.low is not None
        assert signal.high is not None
        assert signal.low < signal.high


def test_an_axis_whose_motor_also_moves_with_another_has_its_samples(tmp_path: Path, healthy: Robot) -> None:
    config, sent = healthy
    (robot,) = config.robot
    coupled = (robot.axis[0], robot.axis[1].model_copy(update={"coupling": {"axis1": 0.1}}))
    found = looked_at(tmp_path, with_axes(config, coupled), sent)
    assert (found.problems, found.missing, found.moves) == ([], 0, True)


def test_a_wrong_sign_is_proposed_to_be_turned(tmp_path: Path, healthy: Robot) -> None:
    """The configuration turns the torque; the bus does not."""
    config, sent = healthy
    turned = changed(config, "axis2", torque={"factor": -1.0})
    found = looked_at(tmp_path, turned, sent)
    assert any("-> torque.factor = 1" in words for words in found.proposals)


def test_lost_frames_are_a_share(tmp_path: Path, healthy: Robot) -> None:
    config, sent = healthy

    def thinned(block: FrameBlock) -> FrameBlock:
        late = block.t_us // 5000 % 10 != 0
        return block.select(late)

    found = looked_at(tmp_path, config, map(thinned, sent))
    assert found.missing == pytest.approx(0.1, abs=0.01)
    assert "of its samples are missing" in " ".join(found.problems)


def test_an_axis_that_sends_nothing_is_reported_by_its_message(tmp_path: Path, healthy: Robot) -> None:
    config, sent = healthy
    three = with_axes(config, demo(tmp_path, 3).robot[0].axis)
    found = looked_at(tmp_path, three, sent, "demo.axis3")
    assert (found.samples, found.rate_hz, found.moves, found.signals) == (0, None, None, [])
    assert "message Axis3State (" in found.problems[0]
    assert f"was not received on bus can0 in {SECONDS:.0f} s" in found.problems[0]


def test_before_the_first_frame_no_message_is_blamed(tmp_path: Path, healthy: Robot) -> None:
    """As while the kernel is compiled at a first start: frames wait."""
    config, _ = healthy
    (problem,) = looked_at(tmp_path, config, []).problems
    assert problem.startswith("no frame has been taken from any bus yet")


def test_old_frames_are_not_taken_for_the_present(tmp_path: Path, healthy: Robot) -> None:
    found = looked_at(tmp_path, *healthy, now_us=NOW_US + 60_000_000)
    assert found.problems[0].startswith("nothing has come for 60 s")
    assert (found.sentences[0].kind, found.sentences[0].values) == ("frames old", {"age_s": "60"})


def test_a_refused_look_has_a_reason(tmp_path: Path, healthy: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    config, _ = healthy
    with pytest.raises(NoLookError, match=r"recordings_mb in \[service\] is 0"):
        SignalLook(lambda: config, None, lambda: NOW_US)("demo.axis1")
    monkeypatch.setattr("service.commands.commissioning.live.signal_look._WAIT_S", 0.01)
    hanging = Extracts(RecordingFolder(tmp_path, 10**6), 20.0, 5.0, lambda: NOW_US)
    look = SignalLook(lambda: config, hanging, lambda: NOW_US)
    with pytest.raises(NoLookError, match="has not handed over"):
        look("demo.axis1")
    with pytest.raises(NoLookError, match=r"no axis demo\.axis9"):
        look("demo.axis9")
    hanging.close()
