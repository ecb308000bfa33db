"""Records with gaps: what is fitted of them, and that ``identify`` then finds what it finds without gaps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from monitor_core.excitation import experiment
from monitor_core.identification import (
    FitQuality,
    GapCut,
    IdentificationOptions,
    Problem,
    Record,
    cut_at_gaps,
    identify,
)
from monitor_core.identification.records.record_parts import long_pieces
from monitor_core.modeling import REFERENCE_VALUES, three_mass
from monitor_core.samples import SampleBlock
from tests.core.identification.problems import EIGHT
from tests.core.identification.record_cases import H

AWAY_S = (6.5, 6.95), (13.2, 13.65)


def steady(*lost: int, count: int = 4000, name: str = "") -> Record:
    """A record without motion, of which the samples from one number to the other are lost."""
    t = np.arange(count, dtype=np.float64) * H
    still = np.zeros(count)
    kept = np.ones(count, np.bool_)
    kept[slice(*lost) if lost else slice(0)] = False
    return Record(t, still, still, "speed", name).select(kept)


@pytest.mark.parametrize(("lost", "left"), [((), [4000]), ((1500, 2000), [1500, 2000]), ((900, 950), [3050])])
def test_long_pieces_are_those_worth_a_fit(lost: tuple[int, ...], left: list[int]) -> None:
    record = steady(*lost)
    assert [len(piece) for piece in long_pieces(record)] == left
    if lost:
        assert long_pieces(record, shortest_s=record.duration_s) == []


def test_each_part_knows_its_record_and_when_it_begins() -> None:
    first, second = steady(name="first"), steady(1500, 2000, name="second")
    parts, cuts = cut_at_gaps([first, second], None, [None, 100.0])
    assert parts[0].record is first
    assert [part.number for part in parts] == [0, 1, 1]
    assert [part.begins_s for part in parts] == [None, 100.0, pytest.approx(100.0 + 2000 * H)]
    assert cuts == (GapCut("second", 2, 1.0),)


def test_the_parts_of_a_single_record_keep_its_own_times() -> None:
    """What is warm before a gap is warm after it, even if the day is not known."""
    parts, _ = cut_at_gaps([steady(1500, 2000)], None)
    assert [part.begins_s for part in parts] == [0.0, pytest.approx(2000 * H)]


def test_a_record_of_which_little_would_be_left_stays_uncut() -> None:
    record = steady(1500, 2000, name="slow")
    parts, cuts = cut_at_gaps([record], slowest_s=record.duration_s)
    assert [part.record for part in parts] == [record]
    assert cuts == (GapCut("slow", 0, 0.0),)


def test_identify_cuts_a_record_where_nothing_was_received(seed: int) -> None:
    """In 999 999 of a million cases the values are as close to the true ones as this."""
    t_us, u, y = experiment(seed, output="angle", samples=4000, noise=1e-3)
    received = ~np.any([(t_us > 1e6 * a) & (t_us < 1e6 * b) for a, b in AWAY_S], axis=0)
    torn = Record.from_samples(SampleBlock(t_us, u, y, name="torn").select(received), "angle")
    problem = Problem(three_mass("angle"), REFERENCE_VALUES, EIGHT)
    options = IdentificationOptions("values")
    found = identify(problem, [torn], options=options)
    e = found.estimate
    assert found.gap_cuts == (GapCut("torn", 3, 1.0),)
    assert [len(trace.t) for trace in found.estimation] == [len(piece) for piece in long_pieces(torn)]
    assert found.options == options
    off = e.theta - np.array([REFERENCE_VALUES[name] for name in e.names])
    assert float(off @ np.linalg.solve(e.covariance, off)) < chi2.isf(1e-6, len(EIGHT))
    assert (found.rejection, found.verdict.quality) == (None, FitQuality.GOOD)
    as_given = identify(problem, [torn], options=replace(options, cut_at_gaps=False))
    assert (as_given.gap_cuts, len(as_given.estimation)) == ((), 1)
    assert as_given.verdict.quality is FitQuality.POOR  # a drive that runs through a gap explains nothing
