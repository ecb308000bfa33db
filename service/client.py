"""A client of a running daemon: its alarms, its history, the epochs of its axes, and its state, over REST."""

from __future__ import annotations

import re
import ssl
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypedDict
from urllib.parse import quote

if TYPE_CHECKING:
    import httpx

TIMEOUT_S = 10.0
MOST_KNOWN = 12
"""Names of what exists, beside what does not"""


class ClientError(Exception):
    """The daemon refuses the request, or does not answer; the text says why.

    ``status`` is that of the answer; None: there was none.
    """

    def __init__(self, text: str, status: int | None = None) -> None:
        self.status = status
        super().__init__(text)

    @property
    def refused(self) -> bool:
        """Whether the request was at fault, and not the daemon."""
        return self.status is not None and 400 <= self.status < 500


class TransitionJson(TypedDict):
    """What has happened to an alarm (the API's AlarmTransition)."""

    at: str
    event: str
    from_state: str
    to_state: str
    until: str | None
    who: str
    comment: str | None
    work_order: str | None


class CauseJson(TypedDict):
    """What an alarm may come from (the API's Cause)."""

    parameter: str
    probability: float
    alike: list[str]


class AlarmJson(TypedDict):
    """An alarm (the API's Alarm, which has more)."""

    id: int | None
    recorded: bool
    axis: str
    parameter: str
    direction: str
    state: str
    priority: str
    shelved_until: str | None
    work_order: str | None
    recording: str | None
    first_out: bool
    follows: int | None
    words: str
    unit: str
    nominal: float | None
    size: float | None
    size_sd: float | None
    causes: list[CauseJson]
    onset: str
    onset_low: str | None
    onset_high: str | None
    raised: str
    ended: str | None


class AlarmRecordJson(AlarmJson):
    """An alarm with all that has happened to it."""

    transitions: list[TransitionJson]


class AlarmsJson(TypedDict):
    """A page of alarms."""

    total: int
    alarms: list[AlarmJson]


class FrequencyJson(TypedDict):
    """How often the alarms of a name were raised (the API's AlarmFrequency)."""

    axis: str
    parameter: str
    direction: str
    alarms: int


class StatisticsJson(TypedDict):
    """How much the alarms ask of an operator (the API's AlarmStatistics, which has more)."""

    since: str
    until: str
    raised: int
    announced: int
    mean_per_ten_minutes: float
    most_in_ten_minutes: int
    most_at: str | None
    flood_share: float
    most_frequent: list[FrequencyJson]


class ServiceStepJson(TypedDict):
    """What a person has made of the service of an axis (the API's AxisServiceStep)."""

    at: str
    event: str
    who: str
    comment: str | None
    work_order: str | None


class AxisServiceJson(TypedDict):
    """Whether an axis is out of service (the API's AxisService, which has more)."""

    axis: str
    steps: list[ServiceStepJson]


class ServiceJson(TypedDict):
    """The daemon itself (the API's Service)."""

    version: str
    ready: bool
    reasons: list[str]
    messages: list[str]
    started: str


class NominalJson(TypedDict):
    """A nominal value of an epoch (the API's NominalValue)."""

    name: str
    unit: str
    value: float | None
    former: float | None
    standard_deviation: float | None
    kept: str | None


class EpochJson(TypedDict):
    """An epoch of an axis (the API's Epoch, which has more)."""

    number: int
    state: str
    source: str
    restored_from: int | None
    began: str
    in_force: str | None
    ended: str | None
    who: str
    comment: str | None
    work_order: str | None
    reason: str | None
    done_s: float | None
    length_s: float | None
    values: list[NominalJson]


class EpochsJson(TypedDict):
    """The epochs of an axis, the newest first (the API's AxisEpochs)."""

    axis: str
    current: int
    epochs: list[EpochJson]


class AlarmText(NamedTuple):
    """What a person writes about an alarm."""

    comment: str = ""
    work_order: str = ""


NOTHING = AlarmText()


class Client:
    """Requests to the daemon at an address; to be used in a ``with`` block.

    Args:
        url: of the daemon, e.g. http://127.0.0.1:8080.
        token: sent as a bearer token; empty: none.

    Every method raises ClientError.
    """

    def __init__(self, url: str, token: str = "") -> None:
        import httpx  # here, so that the help of a command need not wait for it

        token = token.strip()  # a file of it ends with a new line
        if not re.fullmatch(r"[!-~]*", token):
            raise ClientError(
                "the token is none: it has other characters than `axiswatch token new` gives", 400
            )
        headers = {"authorization": f"Bearer {token}"} if token else {}
        try:
            self._http: httpx.Client = httpx.Client(base_url=url, headers=headers, timeout=TIMEOUT_S)
        except (httpx.InvalidURL, UnicodeError, ValueError) as error:
            raise ClientError(f"{url}: {error}; an address is http://HOST:PORT", 400) from error
        self._url = url

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self._http.close()

    def service(self) -> ServiceJson:
        """Version, readiness, messages."""
        found: ServiceJson = self._ask("GET", "service")
        return found

    def alarms(self, **filters: str | int | None) -> AlarmsJson:
        """Alarms, the latest first; the filters are those of GET /api/v1/alarms."""
        query = {name: value for name, value in filters.items() if value is not None}
        found: AlarmsJson = self._ask("GET", "alarms", query=query)
        return found

    def alarm(self, alarm_id: int) -> AlarmRecordJson:
        """One alarm."""
        found: AlarmRecordJson = self._ask("GET", f"alarms/{alarm_id}")
        return found

    def axis(self, axis: str) -> None:
        """Refused where there is no such axis."""
        self._ask("GET", f"axes/{_quoted(axis)}")

    def statistics(self, since: str | None = None, until: str | None = None) -> StatisticsJson:
        """How much the alarms of a time ask of an operator; the default is that of the API, seven days."""
        given = {"since": since, "until": until}
        query = {name: value for name, value in given.items() if value is not None}
        found: StatisticsJson = self._ask("GET", "alarms/statistics", query=query)
        return found

    def change_service(
        self, axis: str, action: Literal["out-of-service", "return-to-service"], text: AlarmText = NOTHING
    ) -> AxisServiceJson:
        """Take an axis out of service, or return it."""
        found: AxisServiceJson = self._ask("POST", f"axes/{_quoted(axis)}/{action}", body=text._asdict())
        return found

    def acknowledge(self, alarm_id: int, text: AlarmText = NOTHING) -> AlarmRecordJson:
        """Acknowledge an alarm."""
        return self._act(alarm_id, "acknowledge", text)

    def shelve(
        self,
        alarm_id: int,
        duration_s: float | None = None,
        until: str | None = None,
        text: AlarmText = NOTHING,
    ) -> AlarmRecordJson:
        """Hide an alarm, for a time [s] or until a time (ISO 8601 with time zone)."""
        end = {"duration_s": duration_s} if until is None else {"until": until}
        return self._act(alarm_id, "shelve", text, end)

    def unshelve(self, alarm_id: int, text: AlarmText = NOTHING) -> AlarmRecordJson:
        """Show an alarm again."""
        return self._act(alarm_id, "unshelve", text)

    def comment(self, alarm_id: int, text: AlarmText) -> AlarmRecordJson:
        """Add a comment or the number of a work order."""
        return self._act(alarm_id, "comment", text)

    def epochs(self, axis: str) -> EpochsJson:
        """The epochs of an axis."""
        found: EpochsJson = self._ask("GET", f"axes/{_quoted(axis)}/epochs")
        return found

    def baseline(self, axis: str, text: AlarmText = NOTHING, **plan: float | str | None) -> EpochJson:
        """Begin a new epoch of an axis; the plan is that of POST /api/v1/axes/{axis}/baseline."""
        body = {**text._asdict(), **{name: value for name, value in plan.items() if value is not None}}
        found: EpochJson = self._ask("POST", f"axes/{_quoted(axis)}/baseline", body=body)
        return found

    def cancel_baseline(self, axis: str, text: AlarmText = NOTHING) -> EpochJson:
        """End the learning window of an axis."""
        found: EpochJson = self._ask("POST", f"axes/{_quoted(axis)}/baseline/cancel", body=text._asdict())
        return found

    def restore_epoch(
        self, axis: str, number: int, verify_hours: float, text: AlarmText = NOTHING
    ) -> EpochJson:
        """Let the values of a former epoch be in force again."""
        body = {**text._asdict(), "verify_hours": verify_hours}
        found: EpochJson = self._ask("POST", f"axes/{_quoted(axis)}/epochs/{number}/restore", body=body)
        return found

    def record(self) -> str:
        """Have the raw frames of the last minutes written to a file; its name."""
        return str(self._ask("POST", "recordings")["name"])

    def recording(self, name: str) -> bytes:
        """The content of a recording, a candump log."""
        return self._send("GET", f"recordings/{name}").content

    def history_file(self, axis: str, kind: str, **query: str | None) -> bytes:
        """The history of an axis as a file, csv or parquet; the rest is as in GET /api/v1/axes/{axis}/history.csv."""
        given: dict[str, str | int] = {name: value for name, value in query.items() if value is not None}
        return self._send("GET", f"axes/{quote(axis, safe='')}/history.{kind}", given).content

    def _act(
        self,
        alarm_id: int,
        action: Literal["acknowledge", "shelve", "unshelve", "comment"],
        text: AlarmText,
        more: Mapping[str, object] | None = None,
    ) -> AlarmRecordJson:
        body = {**text._asdict(), **(more or {})}
        found: AlarmRecordJson = self._ask("POST", f"alarms/{alarm_id}/{action}", body=body)
        return found

    def _ask(
        self,
        method: str,
        path: str,
        query: Mapping[str, str | int] | None = None,
        body: Mapping[str, object] | None = None,
    ) -> Any:
        answer = self._send(method, path, query, body)
        return self._json(answer)

    def _send(
        self,
        method: str,
        path: str,
        query: Mapping[str, str | int] | None = None,
        body: Mapping[str, object] | None = None,
    ) -> httpx.Response:
        import httpx

        try:
            answer = self._http.request(method, f"/api/v1/{path}", params=query, json=body)
        except (httpx.HTTPError, httpx.InvalidURL) as error:
            if _is_untrusted(error):
                authority = "SSL_CERT_FILE names the file of the plant's own authority"
                raise ClientError(
                    f"{self._url}: its certificate is not trusted here ({error}); {authority}"
                ) from error
            raise ClientError(f"{self._url} does not answer ({error}); does the daemon run there?") from error
        if answer.is_error:
            raise ClientError(_reason(self._json(answer)), answer.status_code)
        return answer

    def _json(self, answer: httpx.Response) -> Any:
        try:
            return answer.json()
        except ValueError as error:
            message = f"{self._url} is no axiswatch: it answers {answer.status_code} without JSON"
            raise ClientError(message) from error


def _is_untrusted(error: BaseException | None) -> bool:
    """Whether the certificate of the daemon is behind it."""
    while error is not None and not isinstance(error, ssl.SSLCertVerificationError):
        error = error.__cause__ or error.__context__
    return error is not None


def _quoted(axis: str) -> str:
    """The id of an axis as a part of a path."""
    return quote(axis, safe="")


def _reason(problem: Any) -> str:
    """Why a request was refused, from its problem details."""
    if not isinstance(problem, dict):
        return str(problem)
    detail, known = str(problem.get("detail") or problem), problem.get("known")
    return f"{detail}; there is {', '.join(known)}" if known and len(known) <= MOST_KNOWN else detail
