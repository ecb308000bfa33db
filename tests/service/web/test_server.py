"""The server: a real port, a real stop, clear words when it cannot listen."""

import socket
import threading

import httpx
import pytest

from service.web.server import CannotListenError, listen, serve
from tests.service.web.conftest import Stage


def test_it_serves_on_a_free_port_until_it_is_stopped(stage: Stage) -> None:
    stop, started = threading.Event(), threading.Event()
    ports: list[int] = []

    def ready(port: int) -> None:
        ports.append(port)
        started.set()

    server = threading.Thread(target=serve, args=(stage.app(), "127.0.0.1", 0, ready, stop))
    server.start()
    assert started.wait(30)
    address = f"http://127.0.0.1:{ports[0]}"
    with httpx.Client() as client:
        assert client.get(f"{address}/healthz").status_code == 200
        stop.set()
        server.join(30)
        assert not server.is_alive()
        with pytest.raises(httpx.ConnectError):
            client.get(f"{address}/healthz")
    # The same port can be had again at once.
    listen("127.0.0.1", ports[0]).close()


def test_it_runs_in_the_main_thread_and_leaves_signals_alone(stage: Stage) -> None:
    stop = threading.Event()
    ports: list[int] = []

    def ready(port: int) -> None:
        ports.append(port)
        stop.set()

    serve(stage.app(), "localhost", 0, ready, stop)
    assert len(ports) == 1


def test_a_taken_port_is_said() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(CannotListenError, match=rf"127\.0\.0\.1 port {port}: the port is taken"):
            listen("127.0.0.1", port)


@pytest.mark.parametrize(
    ("host", "why"),
    [
        ("192.0.2.1", "this machine has no such address"),
        ("no such host", "no such host"),
        ("a" * 70, "no such"),
    ],
)
def test_an_address_that_is_not_ours_is_said(host: str, why: str) -> None:
    with pytest.raises(CannotListenError, match=why):
        listen(host, 0)


def test_ipv6_where_there_is_any() -> None:
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError as error:
        pytest.skip(f"this machine has no IPv6: {error}")
    with listen("::1", 0) as listener:
        assert listener.family == socket.AF_INET6
