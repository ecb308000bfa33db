"""Connections as they come from outside: TLS, those that send nothing, and those that send without an end."""

import socket
import ssl
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import httpx
import pytest

from service.web import server
from service.web.server import Certificate, CertificateError, is_remote
from tests.conftest import ROOT
from tests.end_to_end.processes import PATIENCE_S
from tests.service.web.conftest import Stage, serving

TLS = Certificate(ROOT / "tests" / "tls" / "localhost.crt", ROOT / "tests" / "tls" / "localhost.key")
"""For localhost and 127.0.0.1, signed by itself, until 2126; its key protects nothing."""


def port_of(url: str) -> int:
    return int(url.rpartition(":")[2])


def test_over_tls_the_answer_is_encrypted_and_the_browser_keeps_to_it(stage: Stage) -> None:
    with serving(stage, TLS) as url:
        port = port_of(url)
        trusted = ssl.create_default_context(cafile=str(TLS.file))
        answer = httpx.get(f"https://localhost:{port}/healthz", verify=trusted, timeout=PATIENCE_S)
        assert answer.status_code == 200
        assert answer.headers["strict-transport-security"]
        assert "server" not in answer.headers
        with pytest.raises(httpx.ConnectError):
            httpx.get(f"https://localhost:{port}/healthz", timeout=PATIENCE_S)
        with pytest.raises(httpx.TransportError):
            httpx.get(f"http://localhost:{port}/healthz", timeout=PATIENCE_S)


def test_a_certificate_that_was_renewed_is_used_for_new_connections(stage: Stage) -> None:
    own = Certificate(TLS.file, TLS.key)
    with serving(stage, own) as url:
        first = ssl.get_server_certificate(("127.0.0.1", port_of(url)))
        own.renew(Certificate(TLS.file.with_name("renewed.crt"), TLS.key.with_name("renewed.key")))
        second = ssl.get_server_certificate(("127.0.0.1", port_of(url)))
    assert first.split() == TLS.file.read_text(encoding="ascii").split()
    assert second.split() == TLS.file.with_name("renewed.crt").read_text(encoding="ascii").split()


def test_a_connection_that_sends_no_request_is_closed(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even a part of one keeps it open, before the first request or after it."""
    monkeypatch.setattr(server, "SILENT_S", 1.0)  # within it a connection that was made must have sent
    first = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"
    with serving(stage) as url:
        port = port_of(url)
        with ExitStack() as stack:
            opened = []
            for sent in (b"", b"GET / HTTP/1.1\r\nHost: local", first, first + b"GET / HTTP/1.1\r\nHo"):
                opened.append(socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S))
                stack.enter_context(opened[-1]).sendall(sent)
            found = [b"".join(iter(partial(connection.recv, 65536), b"")) for connection in opened]
        assert [b"200 OK" in received for received in found] == [False, False, True, True]


def test_a_body_without_an_end_is_not_read_and_to_head_only_the_head_is_sent(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The request is answered, and the connection closed, though silence would be borne for an hour."""
    monkeypatch.setattr(server, "SILENT_S", 3600.0)
    with serving(stage) as url:
        port = port_of(url)

        def answered(head: str) -> bytes:
            with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as connection:
                connection.sendall(f"{head}\r\n\r\n".encode())
                return b"".join(iter(lambda: connection.recv(65536), b""))

        for line in ("POST /api/v1/alarms", "GET /healthz"):
            for length in ("Content-Length: 1000000000", "Transfer-Encoding: chunked"):
                found = answered(f"{line} HTTP/1.1\r\nHost: localhost\r\n{length}")
                assert (b" 413 " in found) == length.startswith("Content")
                assert b"connection: close" in found.lower()
        found = answered("HEAD /api/v1/axes HTTP/1.1\r\nHost: localhost\r\nConnection: close")
        assert found.startswith(b"HTTP/1.1 200 OK")
        assert found.partition(b"\r\n\r\n")[1:] == (b"\r\n\r\n", b"")
        # Behind a proxy the scheme is that of the connection, whatever the request says.
        answer = httpx.get(
            f"http://127.0.0.1:{port}/healthz", headers={"X-Forwarded-Proto": "https"}, timeout=PATIENCE_S
        )
        assert "strict-transport-security" not in answer.headers


def test_which_addresses_other_machines_reach() -> None:
    assert not any(is_remote(host) for host in ("127.0.0.1", "127.8.9.1", "localhost", "::1"))
    assert all(is_remote(host) for host in ("0.0.0.0", "::", "192.0.2.1", "10.0.0.1"))


def test_a_certificate_that_cannot_be_used_says_why(tmp_path: Path) -> None:
    TLS.check()
    none = tmp_path / "none.key"
    with pytest.raises(CertificateError, match=r"none\.key: No such file"):
        Certificate(TLS.file, none).check()
    none.write_text("no key", encoding="utf-8")
    with pytest.raises(CertificateError, match=r"localhost\.crt and .*none\.key: no PEM certificate with its own"):
        Certificate(TLS.file, none).check()
    with pytest.raises(CertificateError, match=r"the key is encrypted: store it without a password"):
        Certificate(TLS.file, TLS.key.with_name("encrypted.key")).check()
