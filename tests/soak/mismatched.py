"""A plant that is not what its model says, commissioned by the commands that a user has."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
from typer.testing import CliRunner, Result

from monitor_core.excitation import multisine
from service.commands.main import app
from service.commands.options import configuration
from service.config import conditions_of
from service.config.axis_settings import axis_settings
from service.config.drives import axis_model
from tests.core.mismatch_plant import INTERVAL_S, STEP, Block, MismatchPlant, R
from tests.core.mismatch_watch import Watch

PARAMETERS = ("kT", "fc", "fm")
MASSES = ("Jm", "Jg", "Ja", "kg", "ka")
MEMORY_S, WITHIN_S, BUDGET = 5.0, 30.0, "1y"
"""A memory of some motions, as motion and standstill take turns."""
EXCITE_S, EXCITE_HZ, EXCITE_RMS = 60.0, (0.5, 30.0), 1.5
"""The motion that tells the masses: a torque [N m] on top of that of the controller."""
RECORD_S, BETWEEN_S = 300.0, 3600.0
"""Five minutes after a cold start, and five minutes of the warm axis so much later."""
AXIS = f"""\
[[robot]]
name = "cell1"
[[robot.axis]]
name = "axis1"
sample_interval_s = {INTERVAL_S}
time = {{ column = "t" }}
torque = {{ column = "torque" }}
angle = {{ column = "angle", resolution = {STEP} }}
model = {{ drive = "three-mass", monitor = {list(PARAMETERS)}, %s }}
estimator = {{ memory_s = {MEMORY_S} }}
[[robot.axis.signal]]
name = "temperature"
column = "temperature"
"""


class RefusedError(Exception):
    """A command found nothing that it could stand for."""


def commissioned(plant: MismatchPlant, folder: Path, seed: int) -> Path:
    """The configuration with nominal values and thresholds of an axis, from records of it.

    Raises:
        RefusedError: a command does.
    """
    signal = multisine(
        np.random.default_rng(seed), round(EXCITE_S / INTERVAL_S), INTERVAL_S, EXCITE_HZ, EXCITE_RMS
    )
    _write(folder / "excite.csv", plant.take(EXCITE_S, test=signal))
    _write(folder / "cold.csv", plant.take(RECORD_S))
    for _ in range(round(BETWEEN_S / RECORD_S)):
        plant.take(RECORD_S)
    _write(folder / "warm.csv", plant.take(RECORD_S))
    axis, operation = folder / "axis.toml", ["cold.csv", "warm.csv"]
    warming = ("--schedule", "fm: temperature")
    # The masses by themselves, to start from; all; and what is watched from the motion of operation alone.
    values = _identified(folder, {"kT": 1.0, "r": R}, ["excite.csv"])
    start = ("--start", "values") if "Jm" in values else ()
    values = _identified(folder, values, ["excite.csv", *operation], *warming, *start)
    free = ("--start", "values", "--free", "kT,fc,fm,tau0")
    if "Jm" not in values or _identified(folder, values, operation, *warming, *free) is values:
        raise RefusedError("no nominal values")
    axis.write_text(AXIS % 'nominal_file = "nominal.toml"', encoding="utf-8")
    wishes = ("--budget", BUDGET, "--within", str(WITHIN_S), "--sizes", "30", "--onsets", "1")
    result = _run(
        folder, "calibrate", operation, axis, "thresholds.toml", "--report", "calibrate.html", *wishes
    )
    if result.exit_code:
        raise RefusedError(f"no thresholds: {result.output[-1000:]}")
    both = 'nominal_file = "nominal.toml", thresholds_file = "thresholds.toml"'
    axis.write_text(AXIS % both, encoding="utf-8")
    return axis


def _write(path: Path, block: Block) -> None:
    columns = np.column_stack([block.t_us * 1e-6, block.u, block.y, block.temperature])
    header = "t,torque,angle,temperature"
    np.savetxt(
        path, columns, fmt=["%.4f", "%.8g", "%.10g", "%.1f"], delimiter=",", header=header, comments=""
    )


def _identified(folder: Path, values: dict[str, float], records: list[str], *words: str) -> dict[str, float]:
    """What ``identify`` finds from these values; they themselves where it refuses, or says that it cannot tell it."""
    config, found = folder / "identify.toml", folder / "nominal.toml"
    text = ", ".join(f"{name} = {value}" for name, value in values.items())
    config.write_text(AXIS % f"nominal = {{ {text} }}", encoding="utf-8")
    found.unlink(missing_ok=True)
    result = _run(folder, "identify", records, config, found.name, "--report", "identify.html", *words)
    if result.exit_code:
        print(f"identify {' '.join(records)}: {result.output.splitlines()[-1]}")
        return values
    told = tomllib.loads(found.read_text(encoding="utf-8"))
    deviations = told["standard_deviations"]
    if vague := [name for name in MASSES if deviations.get(name, 0.0) > told["values"][name]]:
        print(f"identify {' '.join(records)}: cannot tell {', '.join(vague)}")
        return values
    return dict(told["values"])


def _run(folder: Path, command: str, records: list[str], config: Path, output: str, *words: str) -> Result:
    files = [str(folder / word) if word.endswith((".csv", ".html")) else word for word in (*records, *words)]
    line = [command, *files, "--config", str(config), "--force", "-o", str(folder / output)]
    result = CliRunner().invoke(app, line)
    assert result.exit_code in (0, 2), result.exception
    return result


def watch_of(path: Path) -> Watch:
    """The monitor that a configuration says."""
    (axis,) = configuration(path, without_bus=True).axes
    model, conditions = axis_model(axis.config), conditions_of(axis)
    assert conditions is not None
    return Watch(model, axis_settings(axis, model), conditions)
