"""``axiswatch warm``: compiles all numeric code before the first start."""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING

from service.pipeline.kernel_cache import compile_all

if TYPE_CHECKING:
    from monitor_core.arrays import Floats
    from monitor_core.drive import Output

_INTERVAL_S = 0.005


def warm() -> None:
    """Compile all numeric code of the daemon, identify and excite in advance, so that the next start is fast.

    The cache lies below NUMBA_CACHE_DIR if that is set, else in ~/.cache/axiswatch. It is valid for this version and
    this kind of processor.
    """
    start = perf_counter()
    compile_all()
    monitoring = perf_counter() - start
    compile_offline()
    print(f"the kernel is ready ({perf_counter() - start:.1f} s, {monitoring:.1f} s of it for the daemon)")


def compile_offline() -> None:
    """Compile the code of ``excite`` and ``identify``: a small experiment is planned, simulated and identified."""
    import numpy as np

    from monitor_core.excitation import Estimation, ExcitationTask, MotionLimits, Plant, plan
    from monitor_core.identification import Disturbance, Problem, Record, fit, fit_arx
    from monitor_core.modeling import EXAMPLE_VALUES, two_mass

    drive, values = two_mass("angle"), EXAMPLE_VALUES["two-mass"]
    plant = Plant(drive, values, _INTERVAL_S)
    estimation = Estimation(drive, values, _INTERVAL_S, lam0=1e-6)
    task = ExcitationTask(plant, estimation, MotionLimits(torque=2.0), period=200, periods=1, command="angle")
    rng = np.random.default_rng(0)
    motion = plan(task, rng).motion
    t = _INTERVAL_S * np.arange(len(motion.torque), dtype=np.float64)
    outputs: dict[Output, Floats] = {"speed": motion.speed, "angle": motion.angle}
    for output, y in outputs.items():
        record = Record(t, motion.torque, y + 0.01 * y.std() * rng.standard_normal(len(y)), output)
        disturbance = Disturbance(torque=0.1, slow=0.1)
        problem = Problem(two_mass(output), values, ("Jm", "fm"), free_delay=True, disturbance=disturbance)
        fit(problem, [record], most_iterations=2)
        fit_arx([record], 5)
