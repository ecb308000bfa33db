"""The daemon that other machines reach: tokens, TLS, what is too large, and signals, from outside."""

import json
import re
import signal
import ssl
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

from service.store.tokens import Scope, TokenFile
from tests.conftest import ROOT
from tests.end_to_end.processes import PATIENCE_S, daemon, demo_config, edit, wait_for
from tests.made_certificates import made_certificate

CERTIFICATE = ROOT / "tests" / "tls" / "localhost.crt"


def test_a_daemon_on_all_interfaces_lets_in_those_with_a_token(tmp_path: Path) -> None:
    """SIGHUP in between, with a right and a wrong file; then it ends in order, with a last checkpoint."""
    config = demo_config(tmp_path, 'interface = "virtual"\nchannel = "access"', axes=1)
    web = f'host = "0.0.0.0"\ncertificate = "{CERTIFICATE}"\nkey = "{CERTIFICATE.with_suffix(".key")}"'
    edit(config, ("[[bus]]", f"[web]\n{web}\n\n[[bus]]"))

    tokens = TokenFile(tmp_path / "state" / "tokens.json")
    secret = tokens.new("anna", Scope.READ)
    trusted = ssl.create_default_context(cafile=str(CERTIFICATE))

    with daemon(config) as d:
        port = re.fullmatch(r"https://localhost:(\d+)/", d.page)
        assert port is not None

        def ask(path: str, **extra: Any) -> tuple[int, Any]:
            headers = {"Authorization": f"Bearer {secret}"}
            request = urllib.request.Request(f"https://127.0.0.1:{port[1]}{path}", headers=headers, **extra)
            try:
                with urllib.request.urlopen(request, timeout=PATIENCE_S, context=trusted) as answer:
                    return answer.status, json.loads(answer.read())
            except urllib.error.HTTPError as error:
                return error.code, json.loads(error.read())

        status, service = ask("/api/v1/service")
        assert (status, service["insecure"]) == (200, None)
        assert ask("/api/v1/service", method="POST", data=b"x")[0] == 405
        edit(config, ("[[robot]]", "[[robbot]]"))
        d.process.send_signal(signal.SIGHUP)
        wrong = wait_for(lambda: next((e for e in d.events() if "has mistakes" in e["event"]), None))
        assert any('did you mean "robot"' in problem for problem in wrong["problems"])
        edit(config, ("[[robbot]]", "[[robot]]"))
        d.process.send_signal(signal.SIGHUP)
        wait_for(lambda: next((e for e in d.events() if "the configuration is used" in e["event"]), None))
        assert ask("/healthz")[1]["insecure"] is False
        tokens.revoke("anna")
        assert ask("/api/v1/service")[0] == 401
        assert ask("/api/v1/service", method="POST", data=b"x")[0] == 401
        assert d.stop() == 0
        log = d.events()
    assert log[-1]["event"] == "stopped"
    assert log[-1]["checkpoint"].endswith("Z")
    writes = [(e["who"], e["what"], e["result"]) for e in log if e["event"] == "write request"]
    assert writes == [("anna", "POST /api/v1/service", 405), ("nobody", "POST /api/v1/service", 401)]
    assert secret not in json.dumps(log)


def test_a_certificate_that_expires_soon_is_reported_until_a_new_one_is_loaded(
    tmp_path: Path, need: Callable[[str], str]
) -> None:
    """On the page, in the log once, and as a metric."""
    config = demo_config(tmp_path, 'interface = "virtual"\nchannel = "expiry"', axes=1)
    file = made_certificate(need("openssl"), tmp_path / "cell.crt", 20)
    edit(config, ("[[bus]]", '[web]\ncertificate = "cell.crt"\nkey = "cell.key"\n\n[[bus]]'))
    with daemon(config) as d:
        unverified = ssl._create_unverified_context()

        def get(path: str) -> str:
            with urllib.request.urlopen(d.page + path, timeout=PATIENCE_S, context=unverified) as answer:
                return str(answer.read(), "utf-8")

        def warned() -> list[str]:
            messages: list[str] = json.loads(get("api/v1/service"))["messages"]
            return [message for message in messages if "certificate" in message]

        def days_left() -> int:
            (line,) = [n for n in get("metrics").splitlines() if n.startswith("axiswatch_certificate_expiry_seconds")]
            name, number = line.split()
            assert name == 'axiswatch_certificate_expiry_seconds{use="web"}'
            return round(float(number) / 86400)

        assert days_left() == 20
        (words,) = wait_for(warned)
        assert words.startswith("cell.crt, the certificate of [web], expires at 20")
        d.process.send_signal(signal.SIGHUP)  # the same certificate again
        wait_for(lambda: next((e for e in d.events() if "the configuration is used" in e["event"]), None))
        assert warned() == [words]
        made_certificate(need("openssl"), file, 100)
        assert days_left() == 20  # the daemon still has the former one
        d.process.send_signal(signal.SIGHUP)
        wait_for(lambda: not warned())
        assert days_left() == 100
        assert [e["message"] for e in d.events() if e["event"] == "certificate"] == [words]
        assert d.stop() == 0
