"""A mistake in a configuration as everyone may see it who may read: no secret, no folder."""

from pathlib import Path

import pytest

from service.config import ConfigErrors, load
from service.config.public_text import public_problem
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
