"""The webhook against a receiver over real sockets: what it sends, and what it makes of each answer."""

import asyncio
import hashlib
import hmac
import json
import socket
from email.utils import formatdate
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from docs import build
from service.links.delivery import Message, RefusedError, UnavailableError
from service.links.link_secrets import LinkSecretError, key, secret, tls
from service.links.webhook import Webhook
from service.web import views
from tests.conftest import ROOT
from tests.ports import own_port
from tests.service.links.http_receiver import Answers, Request, receiving
from tests.service.links.journals import AXIS, NAMED, NOON_US, Inbox, Post, record

KEY = b"0123456789abcdef0123456789abcdef"
CERTIFICATE = ROOT / "tests" / "tls" / "localhost.crt"


@pytest.fixture
def message(tmp_path: Path) -> Message:
    inbox = Inbox()
    post = Post(tmp_path, inbox)
    record(post.journal, NAMED)
    post.settle()
    post.close()
    return inbox.got[0]


def webhook(port: int, scheme: str = "http", ca_file: Path | None = None, timeout_s: float = 5.0) -> Webhook:
    url = f"{scheme}://localhost:{port}/axiswatch?key=hunter2"
    return Webhook(url, KEY, tls(ca_file), timeout_s, lambda: NOON_US + 1_500_000)


def sent(hook: Webhook, message: Message) -> None:
    asyncio.run(hook.send([message]))


def received(message: Message) -> Request:
    """What a receiver gets of a message."""
    answers = Answers()
    with receiving(answers) as port:
        sent(webhook(port), message)
    (request,) = answers.requests
    return request


def test_the_message_has_the_schema_of_the_api_and_a_signature(message: Message) -> None:
    request = received(message)
    schema = json.loads(build.SCHEMA.read_text(encoding="utf-8"))
    body = json.loads(request.body)
    stated = schema["webhooks"]["alarm"]["post"]["requestBody"]["content"]["application/json"]["schema"]
    jsonschema.validate(body, {**stated, "components": schema["components"]})
    assert (body["id"], body["event"], body["to_state"]) == (message.id, "raise", "unacknowledged")
    assert body["alarm"] == views.alarm(message.alarm).model_dump(mode="json")
    assert body["alarm"]["axis"] == AXIS
    assert request.headers["content-type"] == "application/json"
    timestamp, signature = (request.headers[f"x-axiswatch-{name}"] for name in ("timestamp", "signature"))
    assert timestamp == "1772366401"
    signed = hmac.new(KEY, timestamp.encode() + b"." + request.body, hashlib.sha256)
    assert signature == f"sha256={signed.hexdigest()}"
    assert KEY not in request.body + str(request.headers).encode()


@pytest.mark.parametrize("status", [200, 202, 204])
def test_accepted(status: int, message: Message) -> None:
    with receiving(Answers([(status, {})])) as port:
        sent(webhook(port), message)


@pytest.mark.parametrize(
    ("status", "headers", "wait_s"),
    [
        (500, {}, None),
        (503, {"Retry-After": "120"}, 120.0),
        (429, {"Retry-After": formatdate(NOON_US / 1e6 + 90, usegmt=True)}, 88.5),
        (429, {"Retry-After": "soon"}, None),
        (408, {}, None),
    ],
)
def test_tried_again(status: int, headers: dict[str, str], wait_s: float | None, message: Message) -> None:
    with (
        receiving(Answers([(status, headers)])) as port,
        pytest.raises(UnavailableError, match=f"localhost:{port} answers {status}") as caught,
    ):
        sent(webhook(port), message)
    assert caught.value.retry_after_s == wait_s
    assert caught.value.args[0].kind == "link answers"


@pytest.mark.parametrize("status", [400, 401, 404, 410, 301, 307])
def test_refused_and_redirects_are_not_followed(status: int, message: Message) -> None:
    elsewhere = Answers()
    with receiving(elsewhere) as other:
        answers = Answers([(status, {"Location": f"http://localhost:{other}/"})])
        with receiving(answers) as port, pytest.raises(RefusedError, match=str(status)) as caught:
            sent(webhook(port), message)
    assert len(answers.requests) == 1
    assert elsewhere.requests == []
    assert "hunter2" not in str(caught.value)


def test_no_answer(message: Message) -> None:
    with socket.create_server(("127.0.0.1", own_port())) as silent:
        port = silent.getsockname()[1]
        with pytest.raises(UnavailableError, match=r"no answer within 0\.1 s"):
            sent(webhook(port, timeout_s=0.1), message)
    with pytest.raises(UnavailableError, match=f"^localhost:{port}: ") as caught:
        sent(webhook(port), message)
    assert "hunter2" not in str(caught.value)


def test_the_certificate_is_verified(message: Message) -> None:
    answers = Answers()
    with receiving(answers, CERTIFICATE) as port:
        with pytest.raises(UnavailableError, match="certificate verify failed"):
            sent(webhook(port, "https"), message)
        assert answers.requests == []
        sent(webhook(port, "https", CERTIFICATE), message)
    assert len(answers.requests) == 1


def test_no_proxy_and_no_password_of_the_environment(
    message: Message, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "netrc").write_text("machine localhost login anna password hunter2")
    monkeypatch.setenv("NETRC", str(tmp_path / "netrc"))
    monkeypatch.setenv("HTTP_PROXY", "http://127.0.0.1:9")
    assert "authorization" not in received(message).headers


# --- Secrets ------------------------------------------------------------------------------------------------


def test_a_secret_is_the_text_of_a_variable_or_of_a_file(tmp_path: Path) -> None:
    file = tmp_path / "orders.secret"
    file.write_text("from the file, 0123456789\n")
    environ = {"SECRET": "from the environment", "EMPTY": ""}
    assert secret(file, "SECRET", environ) == "from the environment"
    assert secret(file, "EMPTY", environ) == secret(file, None) == "from the file, 0123456789"
    assert secret(None, None) is None
    assert key(file, None) == b"from the file, 0123456789"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"", "must hold one line"),
        (b"hunter2\nhunter2hunter2hunter2", "must hold one line"),
        (b"hunter2\xff", "must be UTF-8"),
        (b"hunter2", "at least 16 characters"),
        (None, "No such file"),
    ],
)
def test_a_secret_that_cannot_be_used_is_not_shown(text: bytes | None, words: str, tmp_path: Path) -> None:
    file = tmp_path / "orders.secret"
    if text is not None:
        file.write_bytes(text)
    with pytest.raises(LinkSecretError, match=rf"orders\.secret: .*{words}") as caught:
        key(file, None)
    assert "hunter2" not in str(caught.value)
    with pytest.raises(LinkSecretError, match="variable SECRET of the environment has no text"):
        key(None, "SECRET", {})


def test_an_authority_that_cannot_be_used_names_its_file(tmp_path: Path) -> None:
    (tmp_path / "ca.crt").write_text("no certificate")
    for name, words in (("ca.crt", "holds no PEM certificate"), ("none.crt", "No such file")):
        with pytest.raises(LinkSecretError, match=rf"{name}: .*{words}"):
            tls(tmp_path / name)


def accepted(secret: str, headers: dict[str, str], body: bytes, now: float) -> Any:
    """The lines of docs/operation.md, which a receiver uses."""
    text = (ROOT / "docs" / "operation.md").read_text(encoding="utf-8")
    source = text.split("```python\n# receiver", 1)[1].split("```", 1)[0]
    names: dict[str, Any] = {}
    exec("# receiver" + source, names)
    return names["accept"](secret, headers, body, now)


def test_a_receiver_as_the_documents_have_it_accepts_what_is_sent(message: Message) -> None:
    request, now = received(message), NOON_US / 1e6 + 10
    assert accepted(KEY.decode(), request.headers, request.body, now)["id"] == message.id
    for wrong in (
        (KEY.decode()[1:], request.headers, request.body, now),
        (KEY.decode(), request.headers, request.body + b" ", now),
        (KEY.decode(), request.headers, request.body, now + 400),
        (KEY.decode(), request.headers | {"x-axiswatch-timestamp": str(int(now) + 1)}, request.body, now),
    ):
        with pytest.raises(ValueError, match="refuse"):
            accepted(*wrong)
