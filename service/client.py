"""A client of a running daemon over REST: alarms, history, epochs of axes, and state."""

from __future__ import annotations

import re
import ssl
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal, NamedTuple
from urllib.parse import quote

if TYPE_CHECKING:
    import httpx

TIMEOUT_S, CHANGING_S = 10.0, 130.0
"""Time-outs of a request, and of a request that changes something, for which the daemon may take 120 s"""
UNAUTHORIZED = 401
MOST_KNOWN = 12
"""Most existing names that are listed when a name does not exist"""


class ClientError(Exception):
    """The daemon refuses the request, or does not answer; the text gives the reason.

    ``status`` is that of the answer; None: there was none.
    """

    def __init__(self, text: str, status: int | None = None) -> None:
        self.status = status
        super().__init__(text)

    @property
    def refused(self) -> bool:
        """Whether the request was wrong, and not the daemon."""
        return self.status is not None and 400 <= self.status < 500


ApiAnswer = dict[str, Any]
"""An answer of the API; its fields are in docs/openapi.json."""
JsonValue = str | int | float | None


class Remark(NamedTuple):
    """The texts of a user about an action on an alarm or an axis."""

    comment: str = ""
    work_order: str = ""


AlarmAction = Literal["acknowledge", "shelve", "unshelve", "comment"]


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
            raise ClientError("this is no token: it has characters that no token of `axiswatch token new` has", 400)
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

    def service(self) -> ApiAnswer:
        """Version, readiness and messages of the daemon."""
        return self._ask("GET", "service")

    def alarms(self, **filters: JsonValue) -> ApiAnswer:
        """Alarms, the latest first; the filters are those of GET /api/v1/alarms."""
        return self._ask("GET", "alarms", filters)

    def alarm(self, alarm_id: int) -> ApiAnswer:
        """One alarm with its history."""
        return self._ask("GET", f"alarms/{alarm_id}")

    def axis(self, axis: str) -> ApiAnswer:
        """One axis; refused if the axis does not exist."""
        return self._ask("GET", f"axes/{_quoted(axis)}")

    def statistics(self, since: str | None, until: str | None) -> ApiAnswer:
        """The alarm load of an operator in a span of time; by default that of the API, seven days."""
        return self._ask("GET", "alarms/statistics", {"since": since, "until": until})

    def act(self, alarm_id: int, action: AlarmAction, remark: Remark, **end: JsonValue) -> ApiAnswer:
        """Apply an action to an alarm; end of shelving: ``duration_s``, or ``until`` (ISO 8601 with time zone)."""
        return self._ask("POST", f"alarms/{alarm_id}/{action}", body={**remark._asdict(), **end})

    def change_service(
        self, axis: str, action: Literal["out-of-service", "return-to-service"], remark: Remark
    ) -> ApiAnswer:
        """Take an axis out of service, or return it to service."""
        return self._ask("POST", f"axes/{_quoted(axis)}/{action}", body=remark._asdict())

    def epochs(self, axis: str) -> ApiAnswer:
        """The epochs of an axis, the newest first."""
        return self._ask("GET", f"axes/{_quoted(axis)}/epochs")

    def baseline(self, axis: str, remark: Remark, **plan: JsonValue) -> ApiAnswer:
        """Begin a new epoch of an axis; the plan is that of POST /api/v1/axes/{axis}/baseline."""
        return self._ask("POST", f"axes/{_quoted(axis)}/baseline", body={**remark._asdict(), **plan})

    def cancel_baseline(self, axis: str, remark: Remark) -> ApiAnswer:
        """End the learning window of an axis."""
        return self._ask("POST", f"axes/{_quoted(axis)}/baseline/cancel", body=remark._asdict())

    def restore_epoch(self, axis: str, number: int, verify_hours: float, remark: Remark) -> ApiAnswer:
        """Put the values of a former epoch in force again."""
        body = {**remark._asdict(), "verify_hours": verify_hours}
        return self._ask("POST", f"axes/{_quoted(axis)}/epochs/{number}/restore", body=body)

    def record(self) -> str:
        """Make the daemon write the raw frames of the last minutes to a file; returns its name."""
        return str(self._ask("POST", "recordings")["name"])

    def recording(self, name: str) -> bytes:
        """The content of a recording, a file of frames."""
        return self._send("GET", f"recordings/{_quoted(name)}").content

    def history_file(self, axis: str, kind: str, **query: JsonValue) -> bytes:
        """The history of an axis as a CSV or Parquet file; parameters as of GET /api/v1/axes/{axis}/history.csv."""
        return self._send("GET", f"axes/{_quoted(axis)}/history.{kind}", query).content

    def _ask(
        self, method: str, path: str, query: Mapping[str, JsonValue] = {}, body: Mapping[str, JsonValue] = {}
    ) -> ApiAnswer:
        found: ApiAnswer = self._json(self._send(method, path, query, body))
        return found

    def _send(
        self, method: str, path: str, query: Mapping[str, JsonValue] = {}, body: Mapping[str, JsonValue] = {}
    ) -> httpx.Response:
        """Send a request; arguments that are None are not sent. Returns the answer."""
        import httpx

        params, content = ({k: v for k, v in given.items() if v is not None} for given in (query, body))
        try:
            patience = httpx.Timeout(TIMEOUT_S, read=TIMEOUT_S if method == "GET" else CHANGING_S)
            answer = self._http.request(
                method, f"/api/v1/{path}", params=params, json=content or None, timeout=patience
            )
        except (httpx.HTTPError, httpx.InvalidURL) as error:
            fault = _fault_of_certificate(error)
            if fault == _EXPIRED:
                what = "its certificate has expired: put a new one in its place, and reload the daemon"
                raise ClientError(f"{self._url}: {what}") from error
            if fault is not None:
                authority = "SSL_CERT_FILE names the file of the plant's own authority"
                raise ClientError(f"{self._url}: its certificate is not trusted here ({error}); {authority}") from error
            raise ClientError(f"{self._url} does not answer ({error}); does the daemon run there?") from error
        if answer.is_error:
            hint = "; give it by AXISWATCH_TOKEN or --token" if answer.status_code == UNAUTHORIZED else ""
            raise ClientError(_reason(self._json(answer)) + hint, answer.status_code)
        return answer

    def _json(self, answer: httpx.Response) -> Any:
        try:
            return answer.json()
        except ValueError as error:
            message = f"{self._url} is no axiswatch: it answers {answer.status_code} without JSON"
            raise ClientError(message) from error


_EXPIRED = 10
"""OpenSSL's X509_V_ERR_CERT_HAS_EXPIRED"""


def _fault_of_certificate(error: BaseException | None) -> int | None:
    """The code of a failed check of the daemon's certificate; None: that is not the cause."""
    while error is not None and not isinstance(error, ssl.SSLCertVerificationError):
        error = error.__cause__ or error.__context__
    return None if error is None else error.verify_code


def _quoted(axis: str) -> str:
    """The id of an axis as a part of a path."""
    return quote(axis, safe="")


def _reason(problem: Any) -> str:
    """The reason of a refusal, from its problem details."""
    if not isinstance(problem, dict):
        return str(problem)
    detail, known = str(problem.get("detail") or problem), problem.get("known")
    return f"{detail}; there is {', '.join(known)}" if known and len(known) <= MOST_KNOWN else detail
