"""Who is let in, who may do what, and what every request and every answer has to obey."""

import asyncio
import itertools
import re
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Annotated, Any

import pytest
import structlog
from fastapi import Body, FastAPI
from fastapi.responses import StreamingResponse
from fastapi.testclient import TestClient

from service.store.database import StoreError
from service.store.tokens import TokenFile
from service.web import gate
from service.web.access import Access, Admin, Operator, Scope, UnprotectedError
from service.web.gate import MOST_BODY_BYTES
from service.web.report_pages import ReportPages
from tests.service.web.conftest import Stage

READ_PATHS = (
    "/api/v1/service",
    "/api/v1/axes",
    "/api/v1/axes/demo.axis1",
    "/api/v1/axes/demo.axis1/history",
    "/api/v1/axes/demo.axis1/history.csv",
    "/api/v1/axes/demo.axis1/history.parquet",
    "/api/v1/axes/demo.axis1/trend",
    "/api/v1/alarms",
    "/api/v1/alarms/1",
    "/readyz",
    "/metrics",
    "/openapi.json",
    "/reports/report.html",
    "/nothing",
)


@pytest.fixture
def tokens(tmp_path: Path) -> TokenFile:
    return TokenFile(tmp_path / "tokens.json")


def with_routes(app: FastAPI) -> FastAPI:
    """Routes as they are in the API, for each scope, one of them with a body, and one that fails."""

    @app.post("/reset")
    def reset(who: Operator) -> str:
        return who

    @app.post("/comment")
    def comment(who: Operator, words: Annotated[str, Body(embed=True)]) -> str:
        return f"{who}: {words}"

    @app.delete("/everything")
    def everything(who: Admin) -> str:
        return who

    return app


@pytest.fixture
def asked(stage: Stage, tokens: TokenFile) -> TestClient:
    """A daemon on 127.0.0.1 with a file of tokens, if there is one."""
    stage.access = Access(tokens, ["0.0.0.0", "192.0.2.7", "Axiswatch.Plant.example", "2001:db8::7"])
    return TestClient(with_routes(stage.app()), base_url="http://localhost")


@pytest.fixture
def lines() -> Iterator[list[dict[str, Any]]]:
    with structlog.testing.capture_logs() as found:
        yield found  # type: ignore[misc]


def bearer(secret: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {secret}"}


def refused(answer: Any, status: int) -> str:
    """The words of problem details."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["status"] == status
    assert answer.json()["title"]
    return str(answer.json()["detail"])


# --- tokens -------------------------------------------------------------------------------------------------


def test_without_tokens_this_machine_may_do_all(asked: TestClient) -> None:
    assert asked.get("/api/v1/axes").status_code == 200
    assert asked.post("/reset").json() == "local"
    assert asked.delete("/everything").json() == "local"


def test_with_tokens_data_needs_one(asked: TestClient, tokens: TokenFile) -> None:
    secret = tokens.new("anna", Scope.READ)
    for path in READ_PATHS:
        for headers in ({}, bearer(secret[:-1]), bearer(""), {"Authorization": f"Basic {secret}"}):
            answer = asked.get(path, headers=headers)
            refused(answer, 401)
            assert answer.headers["www-authenticate"].startswith('Bearer realm="axiswatch"')
            assert ("invalid_token" in answer.headers["www-authenticate"]) == bool(headers)
            assert secret[4:-1] not in answer.text + str(answer.headers)
        for header in (f"Bearer {secret}", f"bearer  {secret}"):
            assert asked.get(path, headers={"Authorization": header}).status_code != 401, path


def test_the_files_of_the_page_and_the_sign_of_life_need_none(asked: TestClient, tokens: TokenFile) -> None:
    tokens.new("anna", Scope.READ)
    paths = ("/healthz", "/", "/docs", "/static/page.js")
    assert {asked.get(path).status_code for path in paths} == {200}
    tokens.path.write_text("damaged", encoding="utf-8")
    assert {asked.get(path).status_code for path in paths} == {200}


def test_metrics_need_none_where_that_is_configured_also_while_it_is_served(stage: Stage, tokens: TokenFile) -> None:
    """A changed configuration may close them again, and open them together with a name of the daemon."""
    tokens.new("anna", Scope.READ)
    stage.access = Access(tokens, open_metrics=True)
    client, reader = stage.client(), bearer(tokens.new("ben", Scope.READ))
    assert client.get("/metrics").status_code == 200
    refused(client.get("/api/v1/axes"), 401)
    described = client.get("/openapi.json", headers=reader).json()
    assert "security" not in described["paths"]["/metrics"]["get"]
    stage.access.change([], open_metrics=False)
    refused(client.get("/metrics"), 401)
    stage.access.change(["axiswatch.plant.example"], open_metrics=True)
    assert client.get("/metrics", headers={"Host": "axiswatch.plant.example"}).status_code == 200
    refused(client.get("/readyz"), 401)


def test_each_scope_may_do_what_it_says(asked: TestClient, tokens: TokenFile) -> None:
    answers = {}
    for scope in Scope:
        headers = bearer(tokens.new(scope, scope))
        requests = (("GET", "/api/v1/axes"), ("POST", "/reset"), ("DELETE", "/everything"))
        answers[scope] = [asked.request(*request, headers=headers) for request in requests]
    statuses = {scope: [answer.status_code for answer in found] for scope, found in answers.items()}
    assert statuses == {
        Scope.READ: [200, 403, 403],
        Scope.OPERATE: [200, 200, 403],
        Scope.ADMIN: [200, 200, 200],
    }
    assert "needs a token with the scope operate; that of read is smaller" in refused(answers[Scope.READ][1], 403)
    assert answers[Scope.OPERATE][1].json() == "operate"


def test_a_change_of_the_tokens_holds_at_once_and_their_end_opens_nothing(asked: TestClient, tokens: TokenFile) -> None:
    assert asked.get("/api/v1/axes").status_code == 200
    secret = tokens.new("anna", Scope.READ)
    refused(asked.get("/api/v1/axes"), 401)
    assert asked.get("/api/v1/axes", headers=bearer(secret)).status_code == 200
    tokens.revoke("anna")
    assert "not known, or was revoked" in refused(asked.get("/api/v1/axes", headers=bearer(secret)), 401)
    tokens.path.unlink()
    refused(asked.get("/api/v1/axes"), 401)


def test_tokens_that_cannot_be_read_let_nobody_in_and_are_logged_once(
    asked: TestClient, tokens: TokenFile, lines: list[dict[str, Any]]
) -> None:
    secret = tokens.new("anna", Scope.READ)
    tokens.path.write_text("{", encoding="utf-8")
    for _ in range(3):
        assert "cannot be read" in refused(asked.get("/api/v1/axes", headers=bearer(secret)), 503)
    assert [line["event"] for line in lines] == ["tokens"]
    assert "tokens.json" in lines[0]["message"]
    with pytest.raises(StoreError, match=r"tokens\.json"):
        Access(tokens)


def test_a_link_to_a_report_has_the_token_in_a_cookie_which_is_good_for_nothing_else(
    stage: Stage, tokens: TokenFile, tmp_path: Path
) -> None:
    (tmp_path / "report.html").write_text("<!doctype html>", encoding="utf-8")
    stage.reports, stage.access = ReportPages(tmp_path, []), Access(tokens)
    cookie = {"Cookie": f"a=b; axiswatch-token={tokens.new('anna', Scope.READ)}"}
    client = stage.client()
    assert client.get("/reports/report.html", headers=cookie).status_code == 200
    assert client.get("/reports/report.html").status_code == 401
    assert client.get("/api/v1/axes", headers=cookie).status_code == 401


# --- the rule of the address --------------------------------------------------------------------------------


def test_other_machines_need_tokens_and_tls_or_the_option(tokens: TokenFile) -> None:
    with pytest.raises(UnprotectedError, match=r"a token .* and certificate and key"):
        Access(tokens, remote=True)
    with pytest.raises(UnprotectedError, match=r"needs a token \(axiswatch token new NAME --scope read\); or"):
        Access(tokens, remote=True, tls=True)
    assert Access(tokens, remote=True, insecure=True).danger is not None
    secret = tokens.new("anna", Scope.READ)
    with pytest.raises(UnprotectedError, match="needs certificate and key"):
        Access(tokens, remote=True)
    safe, not_yet_asked = (Access(tokens, remote=True, tls=True) for _ in range(2))
    assert safe.danger is None
    tokens.revoke("anna")
    tokens.path.unlink()
    for access in (safe, not_yet_asked):
        assert (access.caller(None), access.caller(secret), access.danger) == (None, None, None)
    tokens.new("ben", Scope.READ)
    tokens.revoke("ben")
    with pytest.raises(UnprotectedError):  # a file without a token is none
        Access(tokens, remote=True, tls=True)


def test_what_is_insecure_says_so_and_keeps_the_tokens_that_there_are(stage: Stage, tokens: TokenFile) -> None:
    stage.access = Access(tokens, remote=True, insecure=True)
    client = TestClient(with_routes(stage.app()), base_url="http://localhost")
    assert client.post("/reset").json() == "anyone"
    assert client.get("/healthz").json()["insecure"] is True
    assert "may read and operate, without a token; what is sent" in client.get("/api/v1/service").json()["insecure"]
    secret = tokens.new("anna", Scope.READ)
    refused(client.get("/api/v1/service"), 401)
    words = client.get("/api/v1/service", headers=bearer(secret)).json()["insecure"]
    assert words.startswith("insecure: what is sent, tokens too")


# --- the host -----------------------------------------------------------------------------------------------


def test_the_daemon_answers_to_its_names_and_to_no_other(asked: TestClient) -> None:
    """The address to which a request has come is also one: 10.1.2.3, where all interfaces are listened to."""
    client = TestClient(asked.app, base_url="http://10.1.2.3")
    for host in (
        "localhost", "LOCALHOST:8080", "127.0.0.1:8080", "[::1]", "[::1]:8080", "192.0.2.7", "localhost.",
        "axiswatch.plant.example:443", "[2001:DB8::7]:1", "10.1.2.3:8080",
    ):  # fmt: skip
        assert client.get("/api/v1/service", headers={"Host": host}).status_code == 200, host
    for host in (
        "evil.com", "evil.com:8080", "localhost.evil.com", "evil.com#localhost", "localhost@evil.com", "0.0.0.0",
        "192.0.2.70", "127.0.0.1.evil.com", "[::1]evil.com", "::1", "", "localhost:x", "localhost evil.com",
    ):  # fmt: skip
        for path in ("/", "/api/v1/axes"):
            assert "hosts in [web]" in refused(asked.get(path, headers={"Host": host}), 421), host
    two = [("Host", "localhost"), ("Host", "evil.com")]
    assert asked.get("/healthz", headers=two).status_code == 421


# --- what a web page of somebody else may do ------------------------------------------------------------------


def test_a_foreign_page_changes_nothing_and_its_own_does(asked: TestClient) -> None:
    """A browser on this machine would be a local caller, whatever page it shows."""
    for headers in (
        {"Origin": "http://evil.com"},
        {"Origin": "null"},
        {"Origin": "http://["},
        {"Origin": "http://localhost:9999"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site", "Origin": "http://localhost"},
    ):
        assert "page of another host" in refused(asked.post("/reset", headers=headers), 403), headers
        assert "access-control-allow-origin" not in asked.get("/api/v1/axes", headers=headers).headers
    # The second is of a proxy that leaves the port out of Host.
    for origin in ("http://localhost", "https://localhost:8443"):
        own = {"Origin": origin, "Sec-Fetch-Site": "same-origin"}
        assert asked.post("/reset", headers=own).status_code == 200, origin


# --- limits, HEAD, headers ------------------------------------------------------------------------------------


def test_a_large_body_is_refused_before_it_is_read(asked: TestClient) -> None:
    read = list[bytes]()

    def parts() -> Iterator[bytes]:
        for _ in range(1000):
            read.append(b" " * 1024)
            yield read[-1]

    words = {"words": "x" * (MOST_BODY_BYTES - 100)}
    assert asked.post("/comment", json=words).status_code == 200
    for path in ("/comment", "/reset", "/api/v1/axes"):
        answer = asked.post(path, content=b"x" * (MOST_BODY_BYTES + 1))
        assert "65536 bytes" in refused(answer, 413)
        assert answer.headers["connection"] == "close"
        for length in ("-1", "x", "9" * 5000):
            refused(asked.post(path, content=b"", headers={"Content-Length": length}), 413)
    answer = asked.post("/comment", content=parts(), headers={"Content-Type": "application/json"})
    refused(answer, 413)  # of unknown length
    assert answer.headers["connection"] == "close"


def test_a_request_that_takes_too_long_is_given_up(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    app = stage.app()

    @app.get("/slow")
    async def slow() -> None:
        await asyncio.sleep(60)

    async def parts() -> AsyncIterator[bytes]:
        yield b"begun, "
        await asyncio.sleep(0.1)
        yield b"ended"

    @app.post("/change")
    async def change(words: dict[str, str]) -> dict[str, str]:
        await asyncio.sleep(0.2)
        return words

    @app.get("/long")
    async def long_answer() -> StreamingResponse:
        return StreamingResponse(parts())

    monkeypatch.setattr(gate, "LONGEST_REQUEST_S", 0.05)
    client = TestClient(app, base_url="http://localhost")
    assert "within 0.05 s" in refused(client.get("/slow"), 503)
    assert client.get("/long").text == "begun, ended"
    assert client.post("/change", json={"is": "made"}).json() == {"is": "made"}  # what is made is not refused
    monkeypatch.setattr(gate, "LONGEST_CHANGE_S", 0.05)
    refused(client.post("/change", json={}), 503)
    monkeypatch.setattr(gate, "LONGEST_ANSWER_S", 0.05)
    with pytest.raises(TimeoutError):
        client.get("/long")


ADDRESSES = ("/", "/static/page.js", "/api/v1/axes", "/healthz", "/metrics", "/nothing")


def test_head_is_get_without_the_body(asked: TestClient) -> None:
    for path in ADDRESSES:
        full, head = asked.get(path), asked.head(path)
        assert (head.status_code, head.content) == (full.status_code, b"")
        assert head.headers["content-type"] == full.headers["content-type"]


def test_what_is_not_there_and_what_is_not_allowed_are_problems(asked: TestClient) -> None:
    refused(asked.get("/nothing"), 404)
    answer = asked.post("/api/v1/axes")
    refused(answer, 405)
    assert answer.headers["allow"] == "GET"


def test_every_answer_tells_the_browser_what_it_may_not(asked: TestClient) -> None:
    for path, headers in itertools.product(ADDRESSES, ({}, {"Host": "evil.com"})):
        found = asked.get(path, headers=headers).headers
        assert found["x-content-type-options"] == "nosniff"
        assert found["referrer-policy"] == "no-referrer"
        assert found["cross-origin-opener-policy"] == "same-origin"
        assert found["cross-origin-embedder-policy"] == "require-corp"
        assert found["cross-origin-resource-policy"] == "same-origin"
        assert found["content-security-policy"].startswith("default-src 'none'; script-src 'self'")
        page = path in ("/", "/static/page.js")
        assert found["cache-control"] == ("no-cache" if page else "no-store")
        assert "strict-transport-security" not in found
    over_tls = TestClient(asked.app, base_url="https://localhost").get("/healthz").headers
    assert over_tls["strict-transport-security"] == "max-age=31536000"


# --- the log of what was asked to change ------------------------------------------------------------------------


def test_each_write_request_leaves_one_line_and_no_secret(
    asked: TestClient, tokens: TokenFile, lines: list[dict[str, Any]]
) -> None:
    asked.post("/reset")
    reader, operator = tokens.new("anna", Scope.READ), tokens.new("ben", Scope.OPERATE)
    asked.post("/reset?token=x", headers=bearer(operator))
    asked.post("/reset", headers=bearer(reader))
    asked.post("/reset", headers=bearer("wrong"))
    asked.post("/comment", headers=bearer(operator))
    asked.delete("/a%0ab" + "c" * 500, headers=bearer(operator))
    asked.put("/reset", headers={"Host": "evil.com"})
    asked.get("/api/v1/axes", headers=bearer(reader))
    assert [(line["event"], line["who"], line["what"][:14], line["result"]) for line in lines] == [
        ("write request", "local", "POST /reset", 200),
        ("write request", "ben", "POST /reset", 200),
        ("write request", "anna", "POST /reset", 403),
        ("write request", "nobody", "POST /reset", 401),
        ("write request", "ben", "POST /comment", 422),
        ("write request", "ben", "DELETE /a%0abc", 404),
        ("write request", "nobody", "PUT /reset", 421),
    ]
    assert max(len(line["what"]) for line in lines) < 250
    assert not any(secret in str(lines) for secret in (reader, operator, "wrong", "token=x"))


def test_a_fault_of_the_program_is_logged_as_one(stage: Stage, lines: list[dict[str, Any]]) -> None:
    app = stage.app()

    @app.post("/broken")
    def broken() -> None:
        raise ZeroDivisionError("a fault")

    with pytest.raises(ZeroDivisionError):
        TestClient(app, base_url="http://localhost").post("/broken")
    assert [(line["what"], line["result"]) for line in lines] == [("POST /broken", 500)]


# --- the description of the API ---------------------------------------------------------------------------------


def test_the_description_has_the_token_and_both_refusals(asked: TestClient) -> None:
    schema = asked.get("/openapi.json").json()
    assert schema["components"]["securitySchemes"]["token"]["scheme"] == "bearer"
    assert {"type", "title", "status", "detail"} <= set(schema["components"]["schemas"]["Problem"]["properties"])
    for path, methods in schema["paths"].items():
        if path in ("/healthz", "/reset", "/comment", "/everything"):
            continue
        for operation in methods.values():
            assert operation["security"] == [{"token": []}], path
            for status in ("401", "403"):
                assert list(operation["responses"][status]["content"]) == ["application/problem+json"], path


def test_no_route_that_changes_something_is_open_to_readers(asked: TestClient, tokens: TokenFile) -> None:
    schema = asked.get("/openapi.json").json()
    reader = bearer(tokens.new("anna", Scope.READ))
    writing = [
        (method.upper(), re.sub(r"{\w+}", "1", path))
        for path, methods in schema["paths"].items()
        for method in methods
        if method not in ("get", "head", "options")
    ]
    assert {("POST", "/reset"), ("POST", "/comment"), ("DELETE", "/everything")} <= set(writing)
    for method, path in writing:
        refused(asked.request(method, path, headers=reader), 403)
