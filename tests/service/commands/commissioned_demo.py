"""Commissioning of the demo in no time: each axis as it was shipped."""

from __future__ import annotations

import shutil
from collections.abc import Callable

from service.commands.commissioning.axis.axis_job import AxisJob
from service.commands.commissioning.signals.signal_proposals import Review
from service.config.written.corrections import Correction
from service.reports.commissioning_report import Outcome
from tests.conftest import ROOT

COMMISSIONED = ROOT / "config" / "demo" / "axiswatch.toml"


def as_shipped(job: AxisJob, review: Review, _progress: Callable[[str, str, float], None] = lambda *_: None) -> Outcome:
    """The axis with the values of the shipped demo, in place of half a minute of its own identification."""
    assert not review.faults
    assert job.records
    files = {what: f"{job.axis_id}-{what}.toml" for what in ("nominal", "thresholds")}
    for what, name in files.items():
        shutil.copy(COMMISSIONED.with_name(f"demo.axis1-{what}.toml"), job.folder / name)
    drive = Correction(("model", "drive"), "three-mass", "as shipped")
    return Outcome(
        job.axis_id,
        outlook="Can be watched: kT, 1/Ja, fm",
        watched=("kT", "1/Ja", "fm"),
        corrections=(*review.corrections, drive),
        nominal_file=files["nominal"],
        thresholds_file=files["thresholds"],
        within_s=30.0,
        smallest=(("kT", 0.1, -0.1),),
    )
