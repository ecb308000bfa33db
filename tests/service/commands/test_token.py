"""``axiswatch token``, and the rule of the address at the start of the daemon."""

import json
from pathlib import Path

import pytest

from service.store.tokens import TokenFile
from tests import golden
from tests.service.command_line import axiswatch, refused, session, shown
from tests.service.robot_tables import configured


@pytest.fixture
def config(tmp_path: Path) -> Path:
    return configured(tmp_path, "tokens")


def test_a_token_is_made_shown_once_listed_and_revoked(config: Path) -> None:
    file = config.parent / "state" / "tokens.json"
    assert shown("token", "list", "--config", config) == f"no token in {file}\n"
    made = axiswatch("token", "new", "anna", "--scope", "operate", "--config", config)
    secret = made.stdout.strip()
    assert (made.exit_code, made.stdout) == (0, f"{secret}\n")  # alone, for a file
    assert "answers nobody without a token but /healthz" in made.stderr
    caller = TokenFile(file).caller(secret)
    assert caller is not None
    assert (caller.name, len(caller.scopes)) == ("anna", 2)
    shown("token", "new", "ben", "--scope", "read", "--config", config)
    listed = shown("token", "list", "--config", config)
    assert "anna" in listed
    assert "operate" in listed
    assert secret not in listed + made.stderr
    assert "No token is left" not in axiswatch("token", "revoke", "ben", "--config", config).stderr
    assert "delete" in axiswatch("token", "revoke", "anna", "--config", config).stderr
    assert json.loads(file.read_text(encoding="utf-8"))["tokens"] == []


@pytest.mark.usefixtures("folder", "config")
def test_a_mistake_is_answered_with_what_would_be_right() -> None:
    shown("token", "new", "anna", "--scope", "read", "--config", "robot.toml")
    wrong = (
        "new anna --scope read",
        "new 'a b' --scope read",
        "new local --scope read",
        "new ben --scope write",
        "new ben",
        "revoke ana",
    )
    text = session("token", *(f"{words} --config robot.toml" for words in wrong), "remove anna")
    golden.check(text, Path(__file__).parent / "golden" / "token_mistakes.txt")


def test_a_damaged_file_is_named_and_kept(config: Path) -> None:
    file = config.parent / "state" / "tokens.json"
    file.parent.mkdir()
    file.write_text("{}", encoding="utf-8")
    for words in (("list",), ("new", "anna", "--scope", "read"), ("revoke", "anna")):
        assert "tokens.json: this is no file of tokens" in refused("token", *words, "--config", config, code=4)
    assert file.read_text(encoding="utf-8") == "{}"


@pytest.mark.parametrize("host", ["0.0.0.0", "192.0.2.1", "::"])
def test_the_daemon_does_not_let_other_machines_in(host: str, config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing has been opened or written by then: no bus, no port, no state."""
    monkeypatch.setenv("AXISWATCH_WEB__HOST", host)
    words = refused("run", "--config", config)
    for right in ("axiswatch token new NAME", "certificate and key", "--insecure", 'host = "127.0.0.1"'):
        assert right in words
    assert not (config.parent / "state").exists()


def test_a_certificate_that_is_not_there_is_a_mistake(config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AXISWATCH_WEB__CERTIFICATE", "none.crt")
    assert "web.key: missing: it belongs to certificate" in refused("run", "--config", config)
    monkeypatch.setenv("AXISWATCH_WEB__KEY", "none.key")
    assert "none.crt: No such file" in refused("run", "--config", config)
