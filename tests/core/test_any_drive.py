"""The kernel takes any drive: with more masses and more parameters nothing is compiled anew, and it is still right."""

from functools import partial

import numpy as np
import pytest

from monitor_core.drive.structure import Output
from monitor_core.kernel import block
from monitor_core.kernel.block import Trace
from monitor_core.monitoring import AxisBatch
from monitor_core.monitoring import axis_batch as bank_module
from tests.core.cases import BY_NAME, Case, as_columns, record
from tests.core.chains import Sensor, chain, values
from tests.core.differences import TOLERANCE, worst
from tests.core.oracle.paper import Paper

FIVE_MASSES = (
    Case(
        "five-masses-speed",
        "speed",
        ("kT", "f", "1/J5", "k1", "k4", "fa"),
        values(5, gravity=False),
        drive=partial(chain, 5, gravity=False),
    ),
    Case(
        "five-masses-angle",
        "angle",
        ("kT", "f", "J3", "k2", "gc", "gs"),
        values(5),
        drive=partial(chain, 5),
        delay_s=0.0015,
    ),
)
SAMPLES = 500
WITHIN = 0.3
"""Of nominal.  Parameters drawn at random, and a weight to balance, are led anywhere: where the predictor is unstable
it magnifies rounding as all else, and nothing is left to compare."""


@pytest.mark.parametrize("lanes", [False, True], ids=["scalar", "lanes"])
@pytest.mark.parametrize("case", FIVE_MASSES, ids=lambda case: case.name)
def test_five_masses_and_six_parameters(
    case: Case, lanes: bool, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bank_module, "FEWEST_LANES", 1 if lanes else 1000)
    three_masses = BY_NAME["paper"]
    AxisBatch([three_masses.model], [three_masses.settings()]).run(
        *as_columns(record(seed, three_masses, 20))
    )
    compiled = signatures()
    assert compiled

    rec = record(seed, case, SAMPLES, jitter=0.2, gaps=1)
    paper = Paper(case.model, case.settings(alpha1=0.5, alpha2=0.1))
    paper.run(*rec)
    bank = AxisBatch([case.model], [paper.s])
    events, trace = bank.run_traced(*as_columns(rec))

    assert signatures() == compiled
    assert len(case.model.drive.states) >= 9
    differences = worst(Trace(*(field[..., 0] for field in trace)), paper.log)
    assert max(differences.values()) < TOLERANCE, differences
    assert len(events) == len(paper.log.alarms) > 0
    assert (bank.state.theta[:, 0] != case.model.theta0).all()


def signatures() -> list[object]:
    """For each of which the entry of the kernel has been compiled."""
    return list(block.run.signatures)  # type: ignore[attr-defined]


@pytest.mark.parametrize("masses", range(2, 7))
def test_any_number_of_masses_and_any_parameters(masses: int, seed: int) -> None:
    rng = np.random.default_rng(seed + masses)
    output: Output = rng.choice(["speed", "angle"])
    sensor: Sensor = rng.choice(["motor", "gear"])
    gravity = output == "angle"
    given = values(masses, gravity)
    names = [n if rng.random() < 0.5 else f"1/{n}" for n in rng.choice(sorted(given), masses, replace=False)]
    drive = partial(chain, masses, sensor=sensor, gravity=gravity)
    scale = rng.uniform(0.2, 2.0)
    case = Case("any", output, tuple(names), given, drive=drive, speed_scale=scale, within=WITHIN)
    rec = record(seed, case, SAMPLES, jitter=0.2, gaps=1)
    paper = Paper(case.model, case.settings(alpha1=0.5, alpha2=0.5))
    paper.run(*rec)
    _, trace = AxisBatch([case.model], [paper.s]).run_traced(*as_columns(rec))
    differences = worst(Trace(*(field[..., 0] for field in trace)), paper.log)
    assert max(differences.values()) < TOLERANCE, (output, sensor, names, differences)
