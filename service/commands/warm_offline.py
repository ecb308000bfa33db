"""What ``excite`` and ``identify`` compile: brought about by a small experiment, planned, simulated and identified.

Every kind of call that they make is made once; numba keeps what it compiles for it.
"""

from __future__ import annotations

import numpy as np

from monitor_core.drive.structure import Output
from monitor_core.excitation.design import Experiment, Task, plan
from monitor_core.excitation.limits import Limits
from monitor_core.excitation.plant import Plant
from monitor_core.excitation.prediction import Estimation
from monitor_core.identification.arx import fit_arx
from monitor_core.identification.blackbox import fit_blackbox
from monitor_core.identification.greybox import Disturbance, Problem, fit
from monitor_core.identification.record import Record
from monitor_core.modeling.standard_drives import two_mass

_INTERVAL_S = 0.005
_VALUES = {
    "Jm": 0.004, "Ja": 0.01, "k": 50.0, "d": 0.05, "fm": 0.05, "fc": 0.05, "tau0": 0.0, "kT": 1.0, "r": 1.0
}  # fmt: skip
_OUTPUTS: tuple[Output, ...] = ("speed", "angle")


def compile_offline() -> None:
    """Have all that is compiled for planning and identification in numba's cache."""
    experiment = _planned()
    for output in _OUTPUTS:
        _identified(experiment, output)


def _planned() -> Experiment:
    drive = two_mass("angle")
    plant = Plant(drive, _VALUES, _INTERVAL_S)
    estimation = Estimation(drive, _VALUES, _INTERVAL_S, lam0=1e-6)
    task = Task(plant, estimation, Limits(torque=2.0), period=200, periods=1, command="angle")
    return plan(task, np.random.default_rng(0))


def _identified(experiment: Experiment, output: Output) -> None:
    motion, rng = experiment.motion, np.random.default_rng(0)
    y = (motion.speed if output == "speed" else motion.angle)[:, 0]
    t = _INTERVAL_S * np.arange(len(y), dtype=np.float64)
    record = Record(t, motion.torque[:, 0], y + 0.01 * y.std() * rng.standard_normal(len(y)), output)
    problem = Problem(
        two_mass(output),
        _VALUES,
        ("Jm", "fm"),
        free_delay=True,
        disturbance=Disturbance(torque=0.1, slow=0.1),
    )
    fit(problem, [record], most_iterations=2)
    fit_arx([record], 5)
    fit_blackbox([record], 2, past=10, iterations=1)
