"""The content of all reports of an identification: the result, the records it is from, and how it was made."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from monitor_core.identification.identification_result import IdentificationResult, Rejection
from monitor_core.identification.traces import Trace
from service.ingest.identification_records import Source

_MOST_NAMED = 3


@dataclass(frozen=True, eq=False)
class Provenance:
    """How a result was made: ``date`` in ISO 8601, ``drawing`` name and sha256 of the drive's file, if it has one."""

    version: str
    date: str
    command: str
    drawing: tuple[str, str] | None = None


@dataclass(frozen=True, eq=False)
class IdentificationReport:
    """What every report of an identification shows.

    Attributes:
        axis_id: as "robot.axis".
        result: the estimates.
        estimation: sources of the fitted records.
        validation: sources of the records that were kept aside.
        record_warnings: doubts about the records, in sentences.
        provenance: how it was made.
    """

    axis_id: str
    result: IdentificationResult
    estimation: tuple[Source, ...]
    validation: tuple[Source, ...]
    record_warnings: tuple[str, ...]
    provenance: Provenance

    @property
    def warnings(self) -> tuple[str, ...]:
        """All doubts, in sentences: about the records, the number of masses, and the fit."""
        return (*self.record_warnings, *self._other_masses(), *self.result.estimate.words)

    @property
    def rejection(self) -> str:
        """Why there are no nominal values, in a sentence without its full stop; empty: there are."""
        result = self.result
        if result.rejection is Rejection.NOT_CONVERGED:
            return (
                f"the fit has not converged after {result.estimate.iterations} evaluations{self._next_step()}"
            )
        if result.rejection is Rejection.NOT_IDENTIFIABLE:
            names = ", ".join(result.not_identifiable)
            return f"{names} cannot be told from these records: hold one of them with --fix"
        if result.rejection is Rejection.DELAY_OUT_OF_RANGE:
            return (
                f"the torque acts {1e3 * result.delay_s:.3g} ms late, but the daemon can follow delays of 0 to one"
                " interval only: shift the torque against the motion where they are recorded"
            )
        return ""

    def traces(self) -> Iterator[tuple[str, Source, Trace]]:
        """Purpose, source and trace of each record."""
        for purpose, sources, traces in (
            ("estimation", self.estimation, self.result.estimation),
            ("validation", self.validation, self.result.validation),
        ):
            for source, trace in zip(sources, traces, strict=True):
                yield purpose, source, trace

    def _next_step(self) -> str:
        """What to do about a search that does not end."""
        moving = self.result.estimate.moving[:_MOST_NAMED]
        if not moving:
            return ": give a longer record with more motion"
        return (
            f", and {', '.join(moving)} would still move: hold them with --fix at values from another record, such as"
            " one with more excitation, or see with --masses auto how many masses these records ask for"
        )

    def _other_masses(self) -> Iterator[str]:
        recommended, result = self.result.recommended_masses, self.result
        if recommended is not None:
            masses = "one mass" if recommended == 1 else f"{recommended} masses"
            yield (
                f"The records ask for {masses} in a row, and the drive {result.start.drive.name} has {result.masses}:"
                " identify a drive that has as many, from the library or your own."
            )
