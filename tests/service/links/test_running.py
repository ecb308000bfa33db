"""All links of a configuration in their thread: one that hangs, fails or is down does not concern the others."""

import socket
import threading
from contextlib import ExitStack
from pathlib import Path

import httpx
import pytest
import structlog

from service.commands.daemon.lifecycle import run_daemon
from service.config.schema import LinksConfig
from service.links.link_secrets import LinkSecretError
from service.links.webhook import Webhook
from service.store.journal import Journal
from tests.end_to_end.processes import PATIENCE_S, wait_for
from tests.service.daemon_thread import NO_FILE, daemon_thread, on_any_port
from tests.service.links.http_receiver import Answers, receiving
from tests.service.links.journals import just_raised, linked, record
from tests.service.pipeline.robots import demo


def configured(folder: Path, **ports: int) -> LinksConfig:
    """A webhook for each port."""
    (folder / "secret").write_text("0123456789abcdef")
    hooks = [
        {
            "name": name,
            "url": f"http://127.0.0.1:{port}/",
            "secret_file": str(folder / "secret"),
            "timeout_s": 60.0,
        }
        for name, port in ports.items()
    ]
    return LinksConfig.model_validate({"webhook": hooks})


def test_a_receiver_that_hangs_or_is_down_does_not_hold_the_others_up(tmp_path: Path) -> None:
    answers = Answers()
    with ExitStack() as stack:
        silent = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        port = stack.enter_context(receiving(answers))
        ports = {"hangs": silent.getsockname()[1], "down": 9, "works": port}
        links, journal = stack.enter_context(linked(configured(tmp_path, **ports), tmp_path))
        record(journal, just_raised())
        wait_for(lambda: answers.requests and not links.snapshots()[1].connected)
        record(journal, just_raised(), axis="demo.axis2")
        wait_for(lambda: (links.snapshots()[2].delivered, links.snapshots()[2].pending) == (2, 0))
        assert len(answers.requests) == 2
        hangs, down, works = links.snapshots()
        assert (works.delivered, works.pending, works.connected) == (2, 0, True)
        assert (hangs.delivered, down.delivered) == (0, 0)
        assert down.problem.startswith("127.0.0.1:9: ")
    assert "links" not in {thread.name for thread in threading.enumerate()}


def test_a_fault_of_the_program_in_a_link_does_not_end_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    send, broken = Webhook.send, [ZeroDivisionError("a fault")]

    async def once_broken(self: Webhook, messages: object) -> None:
        if broken:
            raise broken.pop()
        await send(self, messages)  # type: ignore[arg-type]

    monkeypatch.setattr(Webhook, "send", once_broken)
    monkeypatch.setattr("service.links.running.FIRST_RETRY_S", 0.01)
    answers = Answers()
    with (
        structlog.testing.capture_logs() as logs,
        receiving(answers) as port,
        linked(configured(tmp_path, orders=port), tmp_path) as (_, journal),
    ):
        record(journal, just_raised())
        wait_for(lambda: answers.requests)
    assert [entry["event"] for entry in logs][:1] == ["a fault in a link; it is started again"]


def test_the_daemon_delivers_and_shows_its_links(tmp_path: Path) -> None:
    with receiving(Answers()) as port:
        config = demo(tmp_path, 1).model_copy(update={"links": configured(tmp_path, orders=port)})
        with daemon_thread(config) as page:
            shown = httpx.get(f"{page}api/v1/service", timeout=PATIENCE_S).json()["links"]
            metrics = httpx.get(f"{page}metrics", timeout=PATIENCE_S).text
    assert [(link["name"], link["kind"], link["connected"]) for link in shown] == [("orders", "webhook", True)]
    assert 'axiswatch_link_connected{link="orders"} 1.0' in metrics
    assert "links" not in {thread.name for thread in threading.enumerate()}
    (tmp_path / "secret").unlink()
    with pytest.raises(LinkSecretError, match="secret: cannot read the secret: No such file"):
        run_daemon(on_any_port(config), NO_FILE)
    Journal(tmp_path / "alarms.sqlite").close()  # nobody holds it any longer
