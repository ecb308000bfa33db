"""What laws of the engine are tested with: lively axes, parts of records, and all bits of a state."""

from hypothesis import settings
from hypothesis import strategies as st

from monitor_core.excitation.reference_experiment import Experiment
from monitor_core.monitoring import AxisMonitor
from monitor_core.settings import Settings
from tests.core.cases import CASES, Case

SAMPLES = 150
seeds = st.integers(0, 2**32 - 1)
cases = st.sampled_from(CASES)
cuts = st.lists(st.integers(0, SAMPLES), max_size=4)
law = settings(deadline=None, max_examples=80)


def lively(case: Case) -> Settings:
    """Large steps, low thresholds: much happens in few samples."""
    return case.settings(relative_sd=0.05, lam=0.97, alpha1=0.2, alpha2=0.2, settle_s=0.1)


def part(rec: Experiment, start: int, stop: int | None = None) -> Experiment:
    return Experiment(rec.t_us[start:stop], rec.u[start:stop], rec.y[start:stop])


def state(monitor: AxisMonitor) -> tuple[bytes, bytes]:
    """All bits but the sign of a zero, which a sum with zero forgets."""
    floats, ints = monitor.batch.column(monitor.lane)
    return (floats + 0.0).tobytes(), ints.tobytes()
