"""A mistake in a configuration as everyone may see it who may read: no secret, no folder."""

from pathlib import Path

import pytest

from monitor_core.wording import Sentence, sentence
from service.config import ConfigErrors, load
from service.config.public_text import public_problem, public_words
from tests.service.pipeline.robots import DEMO


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("[web]\nprt = 80\n", 'web.prt: unknown key: did you mean "port"? '),
        ('[links.mqtt]\npassword = "hunter2"\n', "links.mqtt.password: the log says what is wrong with it"),
        ('[links.mqtt]\nhost = "b"\npasswort = "hunter2"\n', "links.mqtt.passwort: unknown key"),
        ("[web\n", ": this is no TOML"),
    ],
)
def test_a_mistake_without_its_value(tmp_path: Path, more: str, words: str) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(DEMO.read_text(encoding="utf-8") + more, encoding="utf-8")
    with pytest.raises(ConfigErrors) as raised:
        load(file, {})
    public = [*map(public_problem, raised.value.problems)]
    assert any(words in found for found in public)
    for found in public:
        assert found.startswith("robot.toml:")
        assert "hunter2" not in found
        assert str(tmp_path) not in found


@pytest.mark.parametrize(
    ("words", "public"),
    [
        ("/etc/axiswatch/tls/cell.crt: no PEM certificate", "tls/cell.crt: no PEM certificate"),
        ("/etc/axiswatch/../robot.dbc is no valid DBC", "../robot.dbc is no valid DBC"),
        ("/etc/ssl/cell.crt and /etc/ssl/private/cell.key: no PEM", "cell.crt and cell.key: no PEM"),
        ("the folder /srv/state, /srv/state/b and (/srv/c/d)", "the folder state, b and (d)"),
        ("[Errno 28] No space: '/var/lib/x.sqlite'", "[Errno 28] No space: 'x.sqlite'"),
        ("/b/a/x, /a/y", "x, y"),
        ("fm in N m s/rad and 1/(kg m^2), 3 / 4", "fm in N m s/rad and 1/(kg m^2), 3 / 4"),
        ("https://orders.plant.example/axis/watch: 404", "https://orders.plant.example/axis/watch: 404"),
        ("relative/x.dbc and ../y/z.dbc", "relative/x.dbc and ../y/z.dbc"),
    ],
)
def test_words_without_folders(words: str, public: str) -> None:
    assert public_words(words, Path("/etc/axiswatch")) == public


def test_a_sentence_without_folders_can_still_be_translated() -> None:
    inner = sentence("file gone", "{path} is no longer there", path="/var/lib/axiswatch/history.sqlite")
    public = public_words(sentence("history not written", "not written: {why}", why=inner), Path("/etc/axiswatch"))
    assert public == "not written: history.sqlite is no longer there"
    assert isinstance(public, Sentence)
    assert public.values["why"].values == {"path": "history.sqlite"}  # type: ignore[attr-defined]
