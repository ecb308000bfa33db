"""The grey-box fit against peers, all on one record: eight parameters, 8000 samples.

Three masses on the motor side, motor speed at 200 Hz, Schroeder multisine from 0.5 to 40 Hz and white torque, white
noise 30 dB below the speed; every fit starts at the same values, wrong by 10 % on average.  Peers that are no part
of the program's environment get one of their own in .cache/peers, from PyPI; without it they are left out.  They run
once, each between runs of ours: the machine is never quite the same.  The cost is the sum of squares of a simulation
from rest, over that where scipy's search ends: 1 is the same optimum.  Ours fits the initial state as well; peers know
that it is rest.
"""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import least_squares
from scipy.signal import lfilter, ss2tf

from monitor_core.arrays import Floats
from monitor_core.identification.greybox import Estimate, Problem, fit
from monitor_core.identification.problem import Predictor
from monitor_core.modeling.standard_drives import three_mass
from tests.bench import peers
from tests.bench.environments import environment
from tests.bench.measure import Say, in_turns
from tests.core.identification.systems import INTERVAL_S, bench_record

pytestmark = pytest.mark.bench

TRUE = {"Jm": 0.004, "Jg": 0.01, "Ja": 0.006, "kg": 50.0, "ka": 30.0, "dg": 0.08, "da": 0.04, "fm": 0.02}
FIXED = {"kT": 1.0, "r": 1.0, "fc": 0.0, "tau0": 0.0}
OURS = "axiswatch, output error"
FILTER = "scipy, differences, lfilter"
AIM_S = 0.1
ROUNDS = 9
PACKAGES = ("jax-sysid==1.1.0", "sippy-unipi==1.0.1", "nfoursid==1.0.2", "control==0.10.2")
PATIENCE_S = 900.0


class Task:
    """The record and the start values."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.record = bench_record(rng)
        self.u, self.y = self.record.u, self.record.y
        self.start = truth() * np.exp(0.1 * rng.standard_normal(len(TRUE)))

    def ours(self, predictor: Predictor) -> Estimate:
        nominal = {**dict(zip(TRUE, self.start.tolist(), strict=True)), **FIXED}
        return fit(Problem(three_mass("speed"), nominal, tuple(TRUE), predictor=predictor), [self.record])

    def by_loop(self) -> Floats:
        """scipy's least squares with finite differences, the simulation a loop over numpy arrays."""
        return self._differences(lambda A, B: looped(A, B, self.u))

    def by_filter(self) -> Floats:
        """The same, the simulation by scipy's filter: a transfer function, compiled."""
        return self._differences(lambda A, B: filtered(A, B, self.u))

    def timed(self, run: Callable[[], Floats]) -> dict[str, Any]:
        """As the peers state it."""
        start = perf_counter()
        theta = run()
        return {"seconds": perf_counter() - start, "fit": self.fit(theta), "theta": theta.tolist()}

    def _differences(self, run: Any) -> Floats:
        def errors(xi: Floats) -> Floats:
            return np.asarray(self.y - run(*held(np.exp(xi))))

        return np.exp(least_squares(errors, np.log(self.start), method="lm").x)

    def fit(self, theta: Sequence[float] | Floats) -> float:
        return peers.nrmse(looped(*held(np.asarray(theta)), self.u), self.y)


def held(theta: Floats) -> tuple[Floats, Floats]:
    """Ad, Bd of the three masses, written down by hand."""
    J1, J2, J3, k1, k2, d1, d2, f = theta
    X = np.zeros((6, 6))
    X[0, 2], X[0, 3], X[1, 3], X[1, 4] = 1, -1, 1, -1
    X[2, [0, 2, 3, 5]] = -k1 / J1, -(d1 + f) / J1, d1 / J1, 1 / J1
    X[3, :5] = k1 / J2, -k2 / J2, d1 / J2, -(d1 + d2) / J2, d2 / J2
    X[4, [1, 3, 4]] = k2 / J3, d2 / J3, -d2 / J3
    E = expm(X * INTERVAL_S)
    return E[:5, :5], E[:5, 5]


def looped(A: Floats, B: Floats, u: Floats) -> Floats:
    x, y = np.zeros(5), np.empty(u.size)
    for k, value in enumerate(u.tolist()):
        y[k] = x[2]
        x = A @ x + B * value
    return y


def filtered(A: Floats, B: Floats, u: Floats) -> Floats:
    b, a = ss2tf(A, B[:, None], np.eye(5)[2:3], np.zeros((1, 1)))
    return np.asarray(lfilter(b[0], a, u))


@pytest.fixture(scope="module")
def task(seed: int) -> Task:
    return Task(seed)


def test_the_same_fit_by_all(task: Task, say: Say, tmp_path: Path) -> None:
    ours: dict[str, Callable[[], Estimate | Floats]] = {
        OURS: lambda: task.ours("output-error"),
        "axiswatch, innovations": lambda: task.ours("innovations"),
        FILTER: task.by_filter,
    }
    seconds = in_turns(ours, ROUNDS)
    best = seconds[OURS]
    lines = [line(task, name, seconds[name], best, values(ours[name]())) for name in ours]
    lines.append(beside(task, "scipy, differences, numpy loop", lambda: task.timed(task.by_loop)))
    np.savez(tmp_path / "record.npz", u=task.u, y=task.y, h=INTERVAL_S, start=task.start)
    lines += [beside(task, name, partial(peer, name, tmp_path / "record.npz")) for name in peers.TOOLS]
    reference = next(found.fit for found in lines if found.tool == FILTER)
    header = ("tool", "seconds", "times ours", "cost", "fit, simulated, %", "largest error, %")
    title = f"{len(TRUE)} parameters, {task.u.size} samples; aim {AIM_S} s; simulated at the truth: "
    say(f"{title}{task.fit(truth()):.3f} %", header, [found.row(reference) for found in lines])


class Line(NamedTuple):
    """What a tool made of the record; not a number: it did not run."""

    tool: str
    seconds: float = math.nan
    ours: float = math.nan  # in the same minutes
    fit: float = -math.inf  # per cent
    error: str = "-"  # of the worst parameter, per cent; or why there is none

    def row(self, reference: float) -> tuple[object, ...]:
        """With the cost over that of a fit of ``reference`` per cent."""
        if math.isnan(self.seconds):
            return self.tool, *"----", self.error
        cost = ((100 - self.fit) / (100 - reference)) ** 2
        return self.tool, self.seconds, self.seconds / self.ours, f"{cost:.5f}", f"{self.fit:.3f}", self.error


def line(task: Task, tool: str, seconds: float, ours: float, theta: Floats) -> Line:
    return Line(tool, seconds, ours, task.fit(theta), worst(theta))


def beside(task: Task, tool: str, run: Callable[[], dict[str, Any] | str]) -> Line:
    """One run of a peer, between runs of ours."""
    runs = {OURS: lambda: task.ours("output-error")}
    before, found, after = in_turns(runs, ROUNDS), run(), in_turns(runs, ROUNDS)
    if isinstance(found, str):
        return Line(tool, error=found)
    error = worst(found["theta"]) if "theta" in found else "black box"
    return Line(tool, found["seconds"], (before[OURS] + after[OURS]) / 2, found["fit"], error)


def truth() -> Floats:
    return np.array(list(TRUE.values()))


def values(found: Estimate | Floats) -> Floats:
    return found.theta if isinstance(found, Estimate) else found


def worst(theta: Sequence[float] | Floats) -> str:
    return f"{100 * np.abs(np.asarray(theta) / truth() - 1).max():.3f}"


def peer(name: str, record: Path) -> dict[str, Any] | str:
    """One run of a tool in the environment of the peers, or why there is none."""
    python = environment("peers", PACKAGES)
    if isinstance(python, str):
        return python
    done = subprocess.run(
        [python, peers.__file__, record, name],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    if done.returncode:
        return (done.stderr.strip().splitlines() or ["failed"])[-1][:60]
    found: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return found
