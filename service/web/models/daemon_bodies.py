"""Bodies of the daemon itself: buses, links, recordings, readiness, problems."""

from enum import StrEnum
from typing import Literal

from pydantic import Field

from service.web.models.bodies import SENTENCES, Body, Number, Sentence, TextOrNull, Time


class Bus(Body):
    """A bus and its frames since the start."""

    name: str
    up: bool
    state: str = Field(description="up, or the reason why not")
    reader: str = Field(description="how its frames are received; empty where that is not known")
    frames: int = Field(description="frames received")
    dropped: dict[str, int] = Field(description="number of dropped frames, by reason")


class Link(Body):
    """A plant link; numbers since the start of the daemon."""

    name: str
    kind: Literal["webhook", "mqtt", "smtp", "opcua"]
    connected: bool = Field(description="whether it works: the last try has succeeded")
    problem: TextOrNull = Field(description="why it does not, or what the receiver has refused; null: nothing")
    pending: int = Field(description="transitions of alarms that wait")
    delivered: int = Field(description="transitions of alarms that were delivered")
    given_up: dict[str, int] = Field(
        description="number of those that were given up, by reason: age, undeliverable for max_age_s; refused by the"
        " receiver"
    )


class Lack(StrEnum):
    """Kind of a reason why not every axis is monitored, or not every alarm recorded."""

    WORKER = "worker"
    BUS = "bus"
    RECORD = "record"
    SAMPLES = "samples"


class NotReady(Body):
    """A reason why not every axis is monitored, or why alarms are not recorded."""

    lack: Lack = Field(
        description="what is missing: a report of the worker, a bus, the record of alarms, samples of an axis"
    )
    name: str = Field(description="of the bus or axis")
    state: str = Field(description="of the bus")
    since_s: Number | None = Field(
        description="age of the last sample, or of the last report of the worker, in seconds; null: there is none"
    )
    alarms: int = Field(description="number of alarms that are not recorded")


class Service(Body):
    """The daemon itself."""

    version: str
    ready: bool = Field(description="all buses are up and all axes receive samples")
    reasons: list[str] = Field(description="why it is not ready")
    not_ready: list[NotReady] = Field(description="the same as values")
    messages: list[str] = Field(description="for the operator, e.g. that a checkpoint was quarantined")
    started: Time = Field(description="UTC")
    taken: Time = Field(description="when the worker published this, UTC")
    checkpoint: Time | None = Field(description="when the monitors were saved last, UTC")
    buses: list[Bus]
    links: list[Link] = Field(description="plant links, in the order of the configuration")
    report: str | None = Field(description="address of the report of the commissioning; null: there is none")
    insecure: str | None = Field(
        description="why the daemon is not protected where other machines reach it; null: it is"
    )
    sentences: list[Sentence] = Field(description=SENTENCES)


class Health(Body):
    """Whether the process and its worker are alive."""

    alive: bool
    snapshot_age_s: Number = Field(description="seconds since the worker last reported")
    insecure: bool = Field(description="other machines reach the daemon, and it lacks tokens or TLS")


class Readiness(Body):
    """Whether all axes are being monitored."""

    ready: bool
    reasons: list[str] = Field(description="why not every axis is monitored")


class Recording(Body):
    """A file with the raw frames of some minutes."""

    name: str
    size_bytes: int


class Recordings(Body):
    """All recordings."""

    recordings: list[Recording] = Field(description="oldest first")


class Problem(Body):
    """An error of the request, or of the daemon: problem details of RFC 9457."""

    type: str = "about:blank"
    title: str = Field(description="name of the status")
    status: int = Field(description="the HTTP status")
    detail: str = Field(description="what is wrong, and what would be right")
    sentences: list[Sentence] = Field(default=[], description=SENTENCES)
    known: list[str] = Field(default=[], description="existing resources")
