"""What a backup has, under which names, and what it leaves out."""

import shutil
import tarfile
import tomllib
from pathlib import Path

import pytest

from service.config import load
from service.store.archive import MANIFEST
from tests.conftest import ROOT
from tests.end_to_end.processes import demo_config, edit
from tests.service.command_line import axiswatch, refused, shown

WEB = """\
[web]
certificate = "{tls}/localhost.crt"
key = "{tls}/localhost.key"

[[bus]]"""


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """Messages and TLS outside the folder of the configuration, a token, an empty state directory elsewhere."""
    (tmp_path / "robot").mkdir()
    config = demo_config(tmp_path / "robot", axes=1)
    shutil.copytree(ROOT / "tests" / "tls", tmp_path / "tls")
    (tmp_path / "robot" / "demo.dbc").rename(tmp_path / "demo.dbc")
    edit(
        config,
        ('"demo.dbc"', f'"{tmp_path / "demo.dbc"}"'),
        ('state_dir = "state"', f'state_dir = "{tmp_path / "kept"}" # large'),
        ("[[bus]]", WEB.format(tls=tmp_path / "tls")),
    )
    shown("token", "new", "anna", "--scope", "read", "--config", config)
    return config


def names(archive: Path) -> set[str]:
    with tarfile.open(archive) as found:
        return set(found.getnames()) - {MANIFEST}


def test_secrets_are_left_out_and_named(robot: Path, tmp_path: Path) -> None:
    archive = tmp_path / "robot.tar.gz"
    done = axiswatch("backup", "--config", robot, "--output", archive)
    assert (done.exit_code, names(archive)) == (
        0,
        {"robot.toml", "outside/1-demo.dbc", "outside/2-localhost.crt"},
    )
    restored = axiswatch("restore", archive, "--into", tmp_path / "new")
    for secret in ("outside/3-localhost.key", "state/tokens.json"):
        assert f"left out, as it is secret: {secret}; --secrets includes it" in done.stderr
        assert f"copy it to {tmp_path / 'new' / secret}" in restored.stderr
    assert "is there already; --force" in refused("backup", "--config", robot, "--output", archive)
    assert "is not empty" in refused("restore", archive, "--into", tmp_path / "new")


def test_with_secrets_the_daemon_can_run_with_it_at_once(robot: Path, tmp_path: Path) -> None:
    archive, folder = tmp_path / "robot.tar.gz", tmp_path / "new"
    shown("backup", "--config", robot, "--output", archive, "--secrets")
    assert {"outside/3-localhost.key", "state/tokens.json"} < names(archive)
    shown("restore", archive, "--into", folder)
    shutil.rmtree(tmp_path / "tls")
    (tmp_path / "demo.dbc").unlink()
    config = load(folder / "robot.toml", {"STATE_DIRECTORY": "/var/lib/axiswatch"})
    assert config.service.state_dir == folder / "state"
    assert "# large" in (folder / "robot.toml").read_text(encoding="utf-8")
    assert "anna" in shown("token", "list", "--config", folder / "robot.toml")


LINKS = """\
[[links.webhook]]
name = "orders"
url = "https://orders.plant.example/axiswatch"
secret_file = "orders.secret"
ca_file = "{folder}/ca.crt"
[links.mqtt]
host = "broker.plant.example"
user = "cell1"
password_file = "{folder}/mqtt.secret"
[links.opcua]
certificate = "{folder}/opcua.crt"
key = "{folder}/opcua.key"

[[bus]]"""


def test_files_of_links_are_in_it_and_their_secrets_are_left_out(robot: Path, tmp_path: Path) -> None:
    edit(robot, ("[[bus]]", LINKS.format(folder=tmp_path)))
    outside = ("mqtt.secret", "ca.crt", "opcua.crt", "opcua.key")
    for file in (robot.parent / "orders.secret", *(tmp_path / name for name in outside)):
        file.write_text("0123456789abcdef")
    archive = tmp_path / "robot.tar.gz"
    done = axiswatch("backup", "--config", robot, "--output", archive)
    assert done.exit_code == 0
    assert {name for name in names(archive) if not name.endswith(("dbc", "toml", "localhost.crt"))} == {
        "outside/4-ca.crt",
        "outside/6-opcua.crt",
    }
    for secret in ("orders.secret", "outside/5-mqtt.secret", "outside/7-opcua.key"):
        assert f"left out, as it is secret: {secret}; --secrets includes it" in done.stderr
    shown("backup", "--config", robot, "--output", archive, "--secrets", "--force")
    assert {"orders.secret", "outside/5-mqtt.secret"} < names(archive)


def test_what_commissioning_has_left_is_in_it_and_names_stay(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "config" / "demo", tmp_path / "demo")
    config = tmp_path / "demo" / "axiswatch.toml"
    shutil.copyfile(ROOT / "config" / "demo.dbc", tmp_path / "demo.dbc")
    (tmp_path / "demo" / "state").mkdir()
    archive = tmp_path / "robot.tar.gz"
    shown("backup", "--config", config, "--output", archive)
    own = {path.name for path in (tmp_path / "demo").glob("demo.axis*")} | {"report.html", "axiswatch.toml"}
    assert own < names(archive)
    with tarfile.open(archive) as found:
        text = found.extractfile("axiswatch.toml").read().decode()  # type: ignore[union-attr]
    before = tomllib.loads(config.read_text(encoding="utf-8"))
    assert [axis["model"] for axis in tomllib.loads(text)["robot"][0]["axis"]] == [
        axis["model"] for axis in before["robot"][0]["axis"]
    ]


def test_a_state_directory_that_is_not_there(tmp_path: Path) -> None:
    config, archive = demo_config(tmp_path, axes=1), tmp_path / "robot.tar.gz"
    words = refused("backup", "--config", config, "--output", archive, code=4)
    assert "state: No such file" in words
    assert "before its first run there is none yet: --without-state saves the configuration alone" in words
    assert not archive.exists()
    shown("backup", "--config", config, "--output", archive, "--without-state")
    assert names(archive) == {"robot.toml", "demo.dbc"}
    shown("restore", archive, "--into", tmp_path / "new")
    assert load(tmp_path / "new" / "robot.toml", {}).service.state_dir == tmp_path / "new" / "state"


def test_without_state_nothing_of_the_state_directory_is_in_it(robot: Path, tmp_path: Path) -> None:
    archive = tmp_path / "robot.tar.gz"
    shown("backup", "--config", robot, "--output", archive, "--without-state", "--secrets")
    assert names(archive) == {
        "robot.toml",
        "outside/1-demo.dbc",
        "outside/2-localhost.crt",
        "outside/3-localhost.key",
    }
