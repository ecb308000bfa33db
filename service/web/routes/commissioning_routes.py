"""REST under /api/v1/commissioning: progress of the commissioning, and a live check of an axis's signals.

Nothing is started here: the answer names commands to type, as recording and identification take minutes and change
files.
"""

import shlex
from pathlib import Path
from typing import Literal

from fastapi import APIRouter
from pydantic import Field

from service.config import NamedAxis
from service.config.written.commissioning_files import RECORDS, REPORT, motion_file, pages_of
from service.web.access import IsAdmin
from service.web.app_state import AppState, is_silent
from service.web.models import Body, TextOrNull
from service.web.problem_details import described
from service.web.report_pages import ReportPages
from service.web.robot_setup import RobotSetup, SignalCheck

_NOT_FOUND = described(404, "The axis does not exist")
_NO_LOOK = described(503, "No frames are kept, or others look at signals for too long")

StepName = Literal["configure", "signals", "record", "identify", "calibrate", "run"]


class CommissioningStep(Body):
    """A step of the commissioning of the robot."""

    name: StepName
    done: int = Field(description="number of axes for which it is done; step record: number of files")
    total: int | None = Field(description="number of axes; null for the step record, as one file may suffice")
    command: str = Field(description="the command for it, to be typed in the folder")


class AxisCommissioning(Body):
    """Results of the commissioning of an axis."""

    axis: str
    identified: bool = Field(description="its nominal values are from a nominal_file")
    calibrated: bool = Field(description="its thresholds are from a thresholds_file")
    identification: str | None = Field(description="address of the report; null: it is not there")
    calibration: str | None = Field(description="address of the report; null: it is not there")
    motion: str | None = Field(description="file of a planned motion, in the folder; null: none is planned")


class Commissioning(Body):
    """Progress of the commissioning of the robot."""

    folder: TextOrNull = Field(description="of the configuration; null: the scope of the caller is smaller than admin")
    steps: list[CommissioningStep] = Field(description="in their order")
    next: StepName | None = Field(description="the first step that is not done; null: all are")
    report: str | None = Field(description="address of the summary; null: there is none")
    axes: list[AxisCommissioning]


def router(state: AppState) -> APIRouter:
    """The routes below /api/v1/commissioning."""
    api = APIRouter(prefix="/commissioning")

    @api.get("", summary="Steps of the commissioning")
    def commissioning(is_admin: IsAdmin) -> Commissioning:
        """The steps of `axiswatch commission` with their state, their reports and their commands."""
        setup = state.setup
        axes = setup.config().axes
        folder = setup.folder
        steps = _steps(state, setup, axes, folder)
        return Commissioning(
            folder=str(folder) if is_admin else None,
            steps=steps,
            next=next((step.name for step in steps if step.done < (step.total or 0)), None),
            report=state.reports.address,
            axes=[_axis(axis, folder, state.reports) for axis in axes],
        )

    @api.get("/{axis}/signals", summary="Live check of the signals of an axis", responses=_NOT_FOUND | _NO_LOOK)
    def signals(axis: str) -> SignalCheck:
        """Rate, jitter, losses and ranges of the last ten seconds, and their problems in words."""
        found = state.axis(axis)
        return state.setup.look(found.id)

    return api


def _steps(state: AppState, setup: RobotSetup, axes: tuple[NamedAxis, ...], folder: Path) -> list[CommissioningStep]:
    own, total = f"--config {shlex.quote(setup.file.name)}", len(axes)
    heard = [state.snapshot().axis(axis.id) for axis in axes]
    silent = sum(axis is None or is_silent(axis, state.now_us()) for axis in heard)
    records = len(list((folder / RECORDS).glob("*.log")))
    models = [axis.config.model for axis in axes]
    # If a commissioned robot lacks something, all files are written again, beside the same configuration.
    where = "." if (folder / REPORT).is_file() else "commissioned"
    commission = f"axiswatch commission {own} --minutes 10 --output {where}"
    identified = sum(model.nominal_file is not None for model in models)
    calibrated = sum(model.thresholds_file is not None for model in models)
    steps: list[tuple[StepName, int, int | None, str]] = [
        ("configure", total, total, f"axiswatch check {own}"),
        ("signals", total - silent, total, f"axiswatch listen {own}"),
        ("record", records, None, commission),
        ("identify", identified, total, commission),
        ("calibrate", calibrated, total, commission),
        ("run", total, total, f"axiswatch run {own}"),
    ]
    return [CommissioningStep(name=n, done=done, total=most, command=does) for n, done, most, does in steps]


def _axis(axis: NamedAxis, folder: Path, reports: ReportPages | None) -> AxisCommissioning:
    identification, calibration = (None if reports is None else reports.address_of(name) for name in pages_of(axis.id))
    model, motion = axis.config.model, motion_file(axis.id)
    return AxisCommissioning(
        axis=axis.id,
        identified=model.nominal_file is not None,
        calibrated=model.thresholds_file is not None,
        identification=identification,
        calibration=calibration,
        motion=motion if (folder / motion).is_file() else None,
    )
