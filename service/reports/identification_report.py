"""Content of all reports of an identification: the result, its records, and its provenance."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from monitor_core.identification import LEVEL, Growth, IdentificationResult, ParameterRow, Rejection, Trace
from service.ingest.identification_records import Source
from service.reports.text_format import percent, plain

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
        """Advice if the search has not converged."""
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


# --- The result of an identification in the words that all its reports use --------------------------------------------


def number(value: float | None, sd: float | None = None) -> str:
    """Five digits; two where the standard deviation is larger than the value."""
    if value is None:
        return ""
    return plain(value, 5 if sd is None or sd < abs(value) else 2)


def relative(row: ParameterRow) -> str:
    """The standard deviation relative to the value, where that makes sense."""
    return "about 0" if row.is_about_zero else percent(row.relative_sd)


def deviation(row: ParameterRow) -> str:
    """The standard deviation, or why there is none."""
    return plain(row.sd, 2) if row.sd is not None else f"held: {row.held}"


class Tested(NamedTuple):
    """One test of the prediction errors."""

    passed: bool
    words: str


def residual_words(report: IdentificationReport) -> Iterator[Tested]:
    """The two tests of the prediction errors; those of output error need not be white."""
    e = report.result.estimate
    white, p = e.whiteness.p_value >= 1 - LEVEL, e.whiteness.p_value
    if e.problem.predictor == "innovations":
        verdict = (
            "look like white noise, as they should"
            if white
            else "are not white: the noise model is not right"
        )
    else:
        verdict = (
            "are white"
            if white
            else "are not white, which output error allows: what disturbs the axis is slow"
        )
    fine = white or e.problem.predictor == "output-error"
    yield Tested(fine, f"The prediction errors {verdict} (p = {p:.2g}).")
    independent, p = e.independence.p_value >= 1 - LEVEL, e.independence.p_value
    if independent:
        verdict = "do not depend on past torque: the drive explains all that the torque does"
    else:
        verdict = "depend on past torque: the drive does not describe all that the record shows"
    yield Tested(independent, f"The prediction errors {verdict} (p = {p:.2g}).")


def slope_words(report: IdentificationReport) -> Iterator[str]:
    """One sentence on each signal that a parameter follows."""
    for s in report.result.slopes():
        f, unit = s.scheduled, report.result.estimate.drive.parameter(s.scheduled.parameter).unit
        ends = " and ".join(f"{number(s.at(x))} where it is {x:.4g}" for x in (f.low, f.high))
        doubt = "" if s.is_significant else ", which cannot be told from none"
        slope = f"by {number(s.slope, s.sd)} {unit} for each 1 of it (sd {plain(s.sd, 2)}){doubt}"
        yield f"{f.parameter} follows {f.term}, {slope}: {number(s.value)} at {f.reference:g}, {ends}."


class MassesRow(NamedTuple):
    """One number of masses in the comparison, in words; ``wanted``: the records support it."""

    masses: str
    cost: str
    aic: str
    bic: str
    fit: str
    simulated: str
    aside: str
    wanted: bool


MASSES_TITLES = ("masses", "sum of squares", "AIC", "BIC", "one step ahead", "simulated", "kept aside")


def masses_rows(growth: Growth) -> Iterator[MassesRow]:
    """The comparison; AIC and BIC above those of the best."""
    least = [min(getattr(model, name) for model in growth.models) for name in ("aic", "bic")]
    for model in growth.models:
        e = model.estimate
        yield MassesRow(
            str(model.masses),
            plain(e.cost, 5),
            f"{model.aic - least[0]:+.0f}",
            f"{model.bic - least[1]:+.0f}",
            f"{min(e.fit):.2f} %",
            f"{min(e.fit_simulation):.2f} %",
            f"{min(model.validation):.2f} %" if model.validation else "",
            model.masses == growth.recommended,
        )


def predictor_words(report: IdentificationReport) -> str:
    """One line about the predictor."""
    e = report.result.estimate
    unit = "rad" if e.drive.output == "angle" else "rad/s"
    kind = "innovations form" if e.problem.predictor == "innovations" else "output error"
    delay = f", torque {1e3 * e.delay_s:.3g} ms late" if e.delay_s else ""
    return (
        f"{kind}, every {1e3 * e.interval_s:g} ms{delay}; prediction errors of {e.lam0**0.5:.3g} {unit} (standard"
        f" deviation), {e.iterations} evaluations"
    )
