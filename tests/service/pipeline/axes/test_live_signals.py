"""The signals of the last seconds, as the daemon keeps them: those of the kernel, which looking does not change."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from monitor_core.samples import SampleBlock
from service.can.frames import FrameBlock
from service.pipeline.axes.axis_monitors import FramePipeline
from service.pipeline.axes.live_signals import LiveBlock, LiveSignals
from tests.service.pipeline.robots import START_US, blocks
from tests.service.pipeline.running_core import AXIS, OTHER, cell


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory, seed: int) -> Sequence[FrameBlock]:
    """Six seconds of two axes, which settle for 4.5 s."""
    return list(blocks(cell(tmp_path_factory.mktemp("frames")), 6.0, seed))


def pipeline(folder: Path) -> FramePipeline:
    """Whoever looks at it looks on, however long the kernel is compiled: the clock stands still."""
    core = FramePipeline(cell(folder))
    core.live = LiveSignals(lambda: 0.0)
    return core


def kept(core: FramePipeline, frames: Sequence[FrameBlock], axis_id: str) -> LiveBlock:
    """What is kept of an axis that is looked at from the start."""
    core.live.look(axis_id)
    for block in frames:
        core.take("can0", block)
        core.update()
    found = core.live.look(axis_id)
    return LiveBlock(*(np.concatenate([getattr(b, name) for b in found]) for name in LiveBlock._fields))


def test_prediction_and_error_are_those_of_the_kernel_and_looking_changes_no_bit(
    tmp_path: Path, frames: Sequence[FrameBlock]
) -> None:
    looked_at, unseen = pipeline(tmp_path), pipeline(tmp_path)
    found = kept(looked_at, frames, AXIS)
    for block in frames:
        unseen.take("can0", block)
        unseen.update()
    for axis_id in (AXIS, OTHER):
        states = [core.monitors.by_id[axis_id].to_arrays() for core in (looked_at, unseen)]
        assert all(np.array_equal(states[0][name], states[1][name]) for name in states[0])
    assert unseen.live.look(AXIS) == ()
    assert looked_at.live.look(OTHER) == ()
    monitor = looked_at.monitors.by_id[AXIS]
    settled = (found.t_us - START_US) * 1e-6 > monitor.settings.settle_s + 0.1
    assert len(found.t_us) == monitor.status().samples
    assert settled.sum() > 100
    # The first sample starts the predictor; while it settles it predicts, but nothing is learned.
    assert np.isnan(found.yhat[0])
    assert np.isfinite(found.yhat[1:]).all()
    assert np.isnan(found.eps[~settled]).sum() > 10
    learned = np.isfinite(found.eps)
    assert learned[settled].mean() > 0.9
    assert np.array_equal((found.y - found.yhat)[learned], found.eps[learned])
    assert np.std(found.eps[learned]) < 0.1 * np.std(found.y[learned])


def test_an_outlier_is_predicted_though_nothing_is_learned_from_it(
    tmp_path: Path, frames: Sequence[FrameBlock]
) -> None:
    core = pipeline(tmp_path)
    limit = core.monitors.by_id[AXIS].settings.outlier_limit
    assert limit > 0
    found = kept(core, frames[:-1], AXIS)
    scale = np.nanstd(found.eps)
    samples = found.t_us[-1] + 5000 * np.arange(1, 3)
    # The next sample of the axis with an error that noise does not explain.
    last = LiveBlock(samples, *(np.repeat(column[-1:], 2) for column in found[1:]))
    y = last.y + np.array([1e3 * scale, 0.0])
    core.monitors.update({AXIS: SampleBlock(samples, last.u, y)}, core.live.observer())
    outlier = core.live.look(AXIS)[-1]
    assert np.isfinite(outlier.yhat).all()
    assert np.isnan(outlier.eps[0])


def test_axes_that_are_changed_begin_anew(tmp_path: Path, frames: Sequence[FrameBlock]) -> None:
    core = pipeline(tmp_path)
    core.live.look(OTHER)
    kept(core, frames[:5], AXIS)
    core.live.forget([AXIS])
    assert core.live.look(AXIS) == ()
    assert len(core.live.look(OTHER)) == 5
