"""Alarms of several hypotheses that are one alarm: counted, and told beforehand from lower thresholds."""

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.calibration.multimodel_tails import ExcursionPeaks
from monitor_core.calibration.multimodel_thresholds import log_share
from monitor_core.kernel.compile import entry
from tests.core.calibration.healthy_multimodel import excursions_of

N, SIZES = 400_000, (0.25, 0.35, 0.5, 0.7)


def ratios(rng: np.random.Generator, alike: bool) -> Floats:
    """Log-likelihood ratios (N, H) of means of these sizes in white noise: of one noise, or each of its own."""
    noise = rng.standard_normal((N, 1 if alike else len(SIZES)))
    return np.asarray(noise * SIZES - np.square(SIZES) / 2)


def course(llr: Floats, h: Floats | None = None) -> tuple[Floats, int]:
    """g (N, H) and alarms; after each alarm all begin at zero."""
    out = np.empty_like(llr)
    return out, followed(llr, np.full(llr.shape[1], np.inf) if h is None else h, out)


@entry
def followed(llr: Floats, h: Floats, out: Floats) -> int:
    g, alarms = np.zeros(llr.shape[1]), 0
    for k in range(llr.shape[0]):
        alarm = False
        for i in range(g.size):
            g[i] = max(0.0, g[i] + llr[k, i])
            out[k, i] = g[i]
            alarm |= g[i] > h[i]
        if alarm:
            alarms += 1
            g[:] = 0.0
    return alarms


def heights(g: Floats) -> ExcursionPeaks:
    nowhere = np.zeros(len(g), np.int64)
    return excursions_of(g, nowhere, nowhere)


@pytest.mark.parametrize("alike", [True, False], ids=["one noise", "each its own"])
def test_the_share_is_what_is_counted(alike: bool, seed: int) -> None:
    """At thresholds that each hypothesis goes beyond forty times: of one noise it is a half, of their own all."""
    llr = ratios(np.random.default_rng(seed), alike)
    peaks = heights(course(llr)[0])
    h = np.array([base + above[40] for base, above, _ in map(peaks.highest, range(len(SIZES)))])
    _, alarms = course(llr, h)
    together = 40 * len(SIZES)
    (share,) = np.exp(log_share(peaks, len(SIZES), float(np.log(together / N)), np.zeros(1)))
    print(f"{alarms} alarms of {together}: {alarms / together:.2f}, stated {share:.2f}")
    assert share == pytest.approx(alarms / together, abs=0.15)
    assert (share < 0.85) == alike


def test_it_is_nearer_one_where_alarms_are_seldom_and_never_above(seed: int) -> None:
    peaks = heights(course(ratios(np.random.default_rng(seed), alike=True))[0])
    draws = np.array([-1.0, 0.0, 1.0])
    often, seldom = (log_share(peaks, len(SIZES), log_rate, draws) for log_rate in (-8.0, -16.0))
    assert (often < seldom).all()
    assert (seldom < 0).all()
    assert seldom[2] < seldom[1] < seldom[0]
    assert log_share(ExcursionPeaks(2), 2, -8.0, draws).tolist() == [0.0, 0.0, 0.0]
