"""Bodies of the history and of the long-term trend."""

from typing import Literal

from pydantic import Field

from service.store.history_store import Resolution
from service.web.models.bodies import Body, Number, Time


class HistoryColumn(Body):
    """A quantity over time, one number for each entry of ``time``; null if n is 0 or the number is not finite."""

    unit: str
    mean: list[Number] = Field(description="in unit, over all points of the row")
    min: list[Number] = Field(description="in unit")
    max: list[Number] = Field(description="in unit")


class ParameterHistory(Body):
    """History of a parameter in columns; one row for each entry of ``time``."""

    name: str
    unit: str
    nominal: Number = Field(description="present value, in the parameter's unit; null: it is no longer monitored")
    n: list[int] = Field(
        description="points in the row; 0: none, as there were no samples, or the axis was learning or paused, or the"
        " estimate was invalid"
    )
    estimate: HistoryColumn
    deviation: HistoryColumn = Field(description="estimate - nominal value of that time")
    standard_deviation: HistoryColumn = Field(description="of the estimate")
    cusum_up: HistoryColumn = Field(description="g for an increase")
    cusum_down: HistoryColumn = Field(description="g for a decrease")
    threshold: HistoryColumn = Field(description="h of both")
    observability: HistoryColumn = Field(
        description="1 as at commissioning, 0.5 weak, 0 not observed; then the estimate is the last that was observed"
    )


class History(Body):
    """The history of an axis, oldest first; a row without any point is the start of a gap."""

    axis: str
    resolution: Resolution = Field(description="what the rows were made of: points, minutes, hours, days")
    step_s: Number = Field(description="length of a row [s]")
    next: Time | None = Field(
        description="with resolution: start of the remaining rows, to be requested as since; null: there are none"
    )
    time: list[Time] = Field(description="begin of each row, UTC")
    parameters: list[ParameterHistory]


class Reach(Body):
    """When a limit is reached."""

    name: str = Field(description="the limited quantity: the parameter, or its reciprocal")
    limit: Number = Field(description="in unit")
    unit: str = Field(description="1 for a ratio")
    above: bool = Field(description="true: an upper limit; false: a lower limit")
    state: Literal["ahead", "open", "far", "beyond"] = Field(
        description="ahead: reached between low and high with a probability of 90 %; open: after low, perhaps "
        "never; far: not before low, the end of the forecast; beyond: it was reached between low and high"
    )
    low: Time = Field(description="UTC; reached earlier with a probability of 5 %")
    high: Time | None = Field(description="UTC; reached later with a probability of 5 %; null: the interval is open")
    words: str = Field(
        description="the same as a sentence, relative to the last entry or to the last update of the alarm"
    )


class Drift(Body):
    """Result of the trend analysis of a parameter."""

    time: Time = Field(description="last entry that was used, UTC")
    since: Time = Field(description="first entry that was used, UTC")
    steady: Number = Field(description="probability that the parameter is steady")
    drift: Number = Field(description="probability that it drifts, from the beginning or since some time")
    step: Number = Field(description="probability that it stepped")
    both: Number = Field(description="probability that it stepped and has drifted since")
    level: Number = Field(description="present level, in the parameter's unit")
    level_sd: Number = Field(description="its standard deviation")
    slope_per_day: Number = Field(description="averaged over these models, in the parameter's unit per day")
    slope_per_day_sd: Number = Field(description="its standard deviation")
    changed: Time = Field(description="when the likeliest kind of change began, UTC; of a steady one the begin")
    change: Number = Field(description="by how much it has changed since then, in the parameter's unit")
    change_sd: Number = Field(description="its standard deviation")
    scatter: Number = Field(description="standard deviation of an entry about the trend, in the parameter's unit")


class LongTermHistory(Body):
    """Long-term history of a parameter in columns, oldest first: means over hours of operation, later over days."""

    name: str
    unit: str
    nominal: Number = Field(description="commissioned value, in the parameter's unit")
    words: str
    drift: Drift | None = Field(description="null: too few entries yet")
    limits: list[Reach]
    time: list[Time] = Field(description="middle of each entry, UTC")
    mean: list[Number] = Field(
        description="in the parameter's unit; at the reference conditions where its nominal value is scheduled"
    )
    standard_deviation: list[Number] = Field(description="of the mean, from P: a lower bound")
    operating_s: list[Number] = Field(description="operating time in which it was observed [s]")


class Trend(Body):
    """Long-term trends of an axis."""

    axis: str
    interval_s: Number = Field(description="operating time of a complete entry [s]")
    lost: int = Field(description="histories that could not be restored at the start")
    parameters: list[LongTermHistory]
