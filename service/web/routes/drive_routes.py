"""REST of the drive of an axis: components and monitored parameters, nominal and present frequency response."""

from collections.abc import Mapping
from itertools import zip_longest
from typing import NamedTuple

import numpy as np
from fastapi import APIRouter
from pydantic import Field
from starlette.exceptions import HTTPException

from monitor_core.arrays import Floats, finite
from monitor_core.drive import DELAY, LOAD, OUTPUT_UNITS, AxisModel, Drive, split_name
from monitor_core.modeling import COMPONENT_KINDS
from monitor_core.wording import listed
from service.pipeline.axes.axis_pipeline import MonitoredDrive
from service.pipeline.snapshot import AxisSnapshot
from service.web import models
from service.web.app_state import AppState
from service.web.problem_details import NOT_FOUND, described

_ANSWERS = NOT_FOUND | described(503, "The drive of the axis is not known (yet)")
_POINTS = 240
_LOWEST, _HIGHEST = 1e-3, 0.95
"""Lowest and highest frequency, as shares of half the sample rate"""


class ComponentParameter(models.Body):
    """A parameter of a component."""

    role: str = Field(description="e.g. J of an inertia, c and d of a spring-damper")
    text: str = Field(description="as it was drawn: a name, an expression, a number")
    names: list[str] = Field(description="parameters in it")


class Component(models.Body):
    """A component of the drive."""

    name: str
    kind: str = Field(description=f"{listed(tuple(COMPONENT_KINDS), 'or')}; a gain is one of the torque signal")
    nodes: list[str] = Field(description="where it is connected; components at one node turn together there")
    parameters: list[ComponentParameter]


class MonitoredName(models.Body):
    """A monitored parameter, and the drawn parameters that it contains."""

    name: str
    names: list[str] = Field(description="drawn parameters that it consists of: Ja for 1/Ja")


class DriveModel(models.Body):
    """The drive of an axis as it was drawn."""

    axis: str
    drive: str = Field(description="structure, e.g. three-mass")
    components: list[Component]
    monitored: list[MonitoredName]


class BodeCurve(models.Body):
    """A frequency response, a number for each frequency."""

    magnitude_db: list[models.Number] = Field(description="20 log10 of the magnitude in unit")
    phase_deg: list[models.Number] = Field(description="without jumps of a full turn [degrees]")


class Resonance(models.Body):
    """A resonance: an oscillating pair of poles of the drive."""

    nominal_hz: models.Number = Field(description="at the nominal values")
    present_hz: models.Number = Field(description="null: there is none, or no present model")


class Bode(models.Body):
    """Frequency responses from the motor torque to the measured motion, as samples show them."""

    axis: str
    unit: str = Field(description="of the magnitude: rad or rad/s per N m")
    frequency_hz: list[float]
    nominal: BodeCurve = Field(description="with the nominal values that hold now")
    present: BodeCurve | None = Field(description="with the present estimates; null: they give no valid drive")
    magnitude_sd_db: list[models.Number] = Field(
        description="standard deviation of the present magnitude, by that of the estimates; empty: not known"
    )
    phase_sd_deg: list[models.Number] = Field(description="that of the present phase [degrees]")
    resonances: list[Resonance]
    without_estimate: list[str] = Field(
        description="monitored parameters without a valid estimate: the present model has their nominal values"
    )


def router(state: AppState) -> APIRouter:
    """The routes below /api/v1/axes/{axis}."""
    api = APIRouter(prefix="/axes/{axis}", responses=_ANSWERS)

    @api.get("/model", summary="Drive of an axis")
    def model(axis: str) -> DriveModel:
        """The components that the drive was drawn of, and where the monitored parameters are in them."""
        found = state.axis(axis)
        return _drive_body(found, _watched(found))

    @api.get("/bode", summary="Frequency response of an axis")
    def bode(axis: str) -> Bode:
        """Nominal and present frequency response from the motor torque to the measured motion."""
        found = state.axis(axis)
        return _bode_body(found, _watched(found))

    return api


def _watched(axis: AxisSnapshot) -> MonitoredDrive:
    if axis.watched is None:
        raise HTTPException(503, f"the drive of {axis.id} is not known (yet)", headers={"Retry-After": "5"})
    return axis.watched


def _drive_body(axis: AxisSnapshot, watched: MonitoredDrive) -> DriveModel:
    drive = watched.model.drive
    return DriveModel(
        axis=axis.id,
        drive=drive.name,
        components=[
            Component(
                name=c.name,
                kind=c.kind,
                nodes=list(c.nodes),
                parameters=[
                    ComponentParameter(role=role, text=str(value), names=sorted(value.names))
                    for role, value in c.parameters.items()
                ],
            )
            for c in watched.components
        ],
        monitored=[
            MonitoredName(name=name, names=sorted(drawn_names(drive, split_name(name)[0])))
            for name in watched.model.monitored
        ],
    )


def drawn_names(drive: Drive, name: str) -> frozenset[str]:
    """The drawn parameters from which a parameter of the drive is made: itself, or those merged into it."""
    definition = next((d for d in drive.definitions if d.name == name), None)
    if definition is None or definition.names == {name}:
        return frozenset({name})
    return frozenset().union(*(drawn_names(drive, part) for part in definition.names))


# --- The frequency response -------------------------------------------------------------------------------------------


class _Response(NamedTuple):
    curve: BodeCurve
    sd_db: list[float | None]
    sd_deg: list[float | None]
    resonances: tuple[float, ...]
    """Natural frequencies [Hz], ascending"""


def _bode_body(axis: AxisSnapshot, watched: MonitoredDrive) -> Bode:
    model, parameters = watched.model, axis.status.parameters
    half_hz = 0.5 / axis.interval_s
    frequency_hz = np.geomspace(_LOWEST * half_hz, _HIGHEST * half_hz, _POINTS)
    nominal = [p.nominal for p in parameters]
    without = [p.name for p in parameters if not np.isfinite(p.estimate)]
    estimates = [p.nominal if p.name in without else p.estimate for p in parameters]
    at_nominal = _response(watched, model.values(nominal), axis.interval_s, frequency_hz, {})
    P = axis.status.covariance
    # A parameter without an estimate is nominal.  A load changes only the weight, which is not in the response.
    free = {p.name: i for i, p in enumerate(parameters) if P and p.name not in (*without, LOAD)}
    covariance = {name: [P[i][k] for k in free.values()] for name, i in free.items()}
    try:
        present = _response(watched, model.values(estimates), axis.interval_s, frequency_hz, covariance)
    except (ValueError, ZeroDivisionError):  # an estimate that is impossible for its parameter
        present = None
    pairs = zip_longest(at_nominal.resonances, () if present is None else present.resonances)
    return Bode(
        axis=axis.id,
        unit=f"{OUTPUT_UNITS[axis.output]} per N m",
        frequency_hz=frequency_hz.round(6).tolist(),
        nominal=at_nominal.curve,
        present=None if present is None else present.curve,
        magnitude_sd_db=present.sd_db if present is not None and free else [],
        phase_sd_deg=present.sd_deg if present is not None and free else [],
        resonances=[Resonance(nominal_hz=was, present_hz=now) for was, now in pairs],
        without_estimate=without,
    )


def _response(
    watched: MonitoredDrive,
    values: Mapping[str, float],
    interval_s: float,
    frequency_hz: Floats,
    covariance: Mapping[str, list[float]],
) -> _Response:
    """The response at these values; ``covariance``: rows of the covariance of the estimates, by name."""
    from monitor_core.identification import drive_response  # imported here, as few daemons need it
    from monitor_core.modeling import modes

    drive = watched.model.drive
    delay_s = values[DELAY] if DELAY in watched.model.monitored else watched.settings.delay_s
    found = drive_response(drive, values, interval_s, frequency_hz, covariance, delay_s)
    A, _, _ = AxisModel(drive, values, ()).matrices()
    curve = BodeCurve(magnitude_db=found.db.round(4).tolist(), phase_deg=np.degrees(found.phase).round(3).tolist())
    sd_db, sd_deg = (
        [finite(x) for x in column.round(4).tolist()] for column in (found.sd_db, np.degrees(found.sd_phase))
    )
    return _Response(curve, sd_db, sd_deg, tuple(sorted(mode.frequency_hz for mode in modes(np.linalg.eigvals(A)))))
