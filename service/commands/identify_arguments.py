"""Arguments of the command line of ``axiswatch identify``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Beginning(StrEnum):
    """Start of the fit."""

    SEARCH = "search"
    VALUES = "values"
    RECORDS = "records"


class Kind(StrEnum):
    """Predictor."""

    INNOVATIONS = "innovations"
    OUTPUT_ERROR = "output-error"


Records = Annotated[
    list[str],
    typer.Argument(
        metavar="RECORD...",
        help="Tables (.csv .parquet .mat) or CAN logs (.log .asc .blf .trc) of the healthy axis; FILE@10:60 are its"
        " seconds 10 to 60.",
    ),
]
Axis = Annotated[
    str | None,
    typer.Option("--axis", metavar="NAME", help="Which axis, if there are several; its name, or robot.axis."),
]
Free = Annotated[
    list[str] | None,
    typer.Option(
        "--free",
        metavar="NAMES",
        help='Only these parameters, "Jm,fm,1/Ja". Default: all that can be identified with kT and r held.',
    ),
]
Fix = Annotated[
    list[str] | None,
    typer.Option("--fix", metavar="NAMES", help="These stay at their nominal values, beside kT and r."),
]
PredictorOption = Annotated[
    Kind | None, typer.Option("--predictor", help="How the motion is predicted. Default: as configured.")
]
Varying = Annotated[
    list[str] | None,
    typer.Option(
        "--schedule",
        metavar="NAME:SIGNALS",
        help='This parameter follows signals of [[robot.axis.signal]]: "fm: temperature"; "Ja: payload, cos(angle2)".'
        " Of a signal there are cos, sin and square.",
    ),
]
Validate = Annotated[
    list[str] | None,
    typer.Option("--validate", metavar="RECORD", help="Also predict this record, which is not fitted."),
]
Delay = Annotated[bool, typer.Option("--delay", help="Also find by how much the torque acts late.")]
Slow = Annotated[
    float | None,
    typer.Option(
        "--disturbance",
        metavar="SECONDS",
        min=1e-3,
        help="What disturbs the torque also has a slow part with this time constant, a state of the model.",
    ),
]
HoldNoise = Annotated[
    bool,
    typer.Option(
        "--hold-noise",
        help="The gain follows from torque_noise and output_noise as configured. Default: from noise found in the"
        " records.",
    ),
]
Robust = Annotated[bool, typer.Option("--robust", help="Outliers count less (Huber's loss).")]
StartOption = Annotated[
    Beginning | None,
    typer.Option(
        "--start",
        help="Where the fit starts: at the configured values and where a search around them ends; there only (fast);"
        " or at what the records alone tell. Default: search; records where the configuration has no values.",
    ),
]
MassesOption = Annotated[
    str | None,
    typer.Option(
        "--masses",
        metavar="auto|N",
        help="Also say how many masses in a row the records ask for: rows of up to five (auto) or N are compared.",
    ),
]
Folder = Annotated[
    Path | None,
    typer.Option("--output-dir", metavar="DIR", help="Where nominal.toml and report.html go. Default: here."),
]
Output = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="FILE", help="The nominal values; default nominal.toml."),
]
Report = Annotated[
    Path | None, typer.Option("--report", metavar="FILE", help="The report; default report.html beside them.")
]
JsonFile = Annotated[
    Path | None,
    typer.Option(
        "--json", metavar="[FILE]", help="Also write everything here; - or nothing is standard output."
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite files that are there already.")]
