"""What is reported when a file cannot be read, when much is wrong at once, and from the environment."""

import tomllib
from pathlib import Path

import pytest

from service.config import ConfigErrors, load
from service.config.written.commissioned import relocated
from tests.service.config.config_texts import BASE, furnish


@pytest.fixture
def file(tmp_path: Path) -> Path:
    file = furnish(tmp_path) / "a.toml"
    file.write_text(BASE, encoding="utf-8")
    return file


def messages(file: Path, environ: dict[str, str] | None = None) -> list[str]:
    with pytest.raises(ConfigErrors) as caught:
        load(file, environ or {})
    assert str(caught.value) == "\n".join(map(str, caught.value.problems))
    return [str(problem).replace(str(file), "a.toml") for problem in caught.value.problems]


def test_a_right_file(file: Path) -> None:
    config = load(file, {})
    first, second = (axis.config for axis in config.axes)
    assert (first.output, first.motion.signal, second.output, second.motion.signal) == (
        *("angle", "Angle"),
        *("speed", "Speed"),
    )
    assert (first.pairing_tolerance_s, first.max_gap_s) == pytest.approx((0.002, 0.06))
    assert (second.pairing_tolerance_s, second.max_gap_s) == pytest.approx((0.0016, 0.04))
    assert config.service.state_dir == file.parent / "kept"
    assert config.bus[0].messages == file.parent / "robot.dbc"
    assert config.bus[0].options == {"receive_own_messages": True}


def test_what_cannot_be_read(file: Path) -> None:
    for path, reason in (
        (file.parent / "no" / "a.toml", "No such file or directory"),
        (file.parent, "Is a directory"),
    ):
        (message,) = messages(path)
        assert message.endswith(f"cannot read the configuration: {reason}")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_bytes_that_are_no_text(encoding: str, file: Path) -> None:
    file.write_bytes(BASE.encode(encoding) + b"\xe9 in a Western code page\n")
    line = BASE.count("\n") + 1
    assert messages(file) == [f"a.toml:{line}: the file must be UTF-8 text; this line holds other bytes"]


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("[web]\nport = \n", "2:8"),
        ("[web]\nport = 1\nport = 2\n", "3:9"),
        ("[web\n", "1:5"),
        ('a = """open\nx', "2:2"),
        ("", None),
    ],
)
def test_syntax_errors_have_line_and_column(text: str, place: str | None, file: Path) -> None:
    file.write_text(text, encoding="utf-8")
    found = messages(file)
    if place is None:  # an empty file is TOML
        assert [message.split(": ")[1] for message in found] == ["robot"]
    else:
        assert [message.startswith(f"a.toml:{place}: this is no TOML: ") for message in found] == [True]


def test_a_byte_order_mark_is_nothing(file: Path) -> None:
    file.write_text(BASE, encoding="utf-8-sig")
    assert len(load(file, {}).axes) == 2


def test_an_interface_that_is_near(file: Path) -> None:
    file.write_text(BASE.replace('"virtual"', '"virtaul"'), encoding="utf-8")
    (message,) = messages(file)
    place = 'a.toml:7: bus[1].interface = "virtaul": '
    assert message.startswith(f'{place}python-can has no such interface: did you mean "virtual"')


def test_the_environment_wins(file: Path) -> None:
    """A number may be a name; no section is needed in the file; a mistake beside it is not hidden."""
    environ = {
        "AXISWATCH_WEB__PORT": "9000",
        "axiswatch_web__host": "0.0.0.0",
        "AXISWATCH_SERVICE__STATE_DIR": "elsewhere",
        "AXISWATCH_SERVICE__HISTORY_INTERVAL_S": "2.5",
        "AXISWATCH_WEB__HOSTS": "axiswatch.plant.example, 2001:db8::7",
        "AXISWATCH_WEB__OPEN_METRICS": "true",
        "AXISWATCH_WEB__CERTIFICATE": "tls/own.crt",
        "AXISWATCH_WEB__KEY": "/etc/own.key",
        "AXISWATCH_DATA": "not a setting",
        "PATH": "/bin",
    }
    config = load(file, environ)
    assert (config.web.port, config.web.host) == (9000, "0.0.0.0")
    assert (config.web.hosts, config.web.open_metrics) == (("axiswatch.plant.example", "2001:db8::7"), True)
    assert (config.web.certificate, config.web.key) == (file.parent / "tls" / "own.crt", Path("/etc/own.key"))
    assert config.service.state_dir == file.parent / "elsewhere"
    assert config.service.history_interval_s == 2.5
    assert (config.service.history_raw_days, config.service.history_mb) == (7, 1000)
    assert load(file, {"AXISWATCH_SERVICE__STATE_DIR": "2026"}).service.state_dir.name == "2026"
    file.write_text(BASE.replace("[web]\nport = 8080\n", ""), encoding="utf-8")
    assert load(file, {"AXISWATCH_WEB__PORT": "1234"}).web.port == 1234
    file.write_text(BASE.replace("[web]\nport = 8080", "web = 3"), encoding="utf-8")
    assert len(messages(file, {"AXISWATCH_WEB__PORT": "1"})) == 1


def test_without_a_table_of_the_service_its_state_lies_beside_the_file(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    start = text.index("[service]")
    file.write_text(text[:start] + text[text.index("\n[", start) :], encoding="utf-8")
    assert load(file, {}).service.state_dir == file.parent / "state"


def test_systemd_says_where_the_state_is_unless_the_configuration_does(file: Path) -> None:
    environ = {"STATE_DIRECTORY": "/var/lib/axiswatch:/var/lib/other"}
    assert load(file, environ).service.state_dir == file.parent / "kept"
    text = file.read_text(encoding="utf-8")
    assert 'state_dir = "kept"\n' in text
    file.write_text(text.replace('state_dir = "kept"\n', ""), encoding="utf-8")
    assert load(file, environ).service.state_dir == Path("/var/lib/axiswatch")
    assert load(file, {}).service.state_dir == file.parent / "state"
    assert load(file, environ | {"AXISWATCH_SERVICE__STATE_DIR": "/other"}).service.state_dir == Path("/other")


@pytest.mark.parametrize(
    ("variable", "value", "words"),
    [
        ("AXISWATCH_WEB__PORT", "many", "must be a whole number"),
        ("AXISWATCH_WEB__PORT", "99999", "must be at most 65535"),
        ("AXISWATCH_WEB__PROT", "1", 'unknown key: did you mean "port"'),
        ("axiswatch_Web__prot", "1", 'unknown key: did you mean "port"'),
        ("AXISWATCH_SERVICE__HISTORY_RAW_DAYS", "-1", "must be greater than 0"),
        ("AXISWATCH_WEB__OPEN_METRICS", "perhaps", "must be true or false"),
        ("AXISWATCH_WEB__HOSTS", "plant:8080", "must be a name or an address, without port"),
        ("AXISWATCH_WEB__HOSTS", "a,[::1]", "must be a name or an address, without port"),
        ("AXISWATCH_WEB__HOSTS", "https://plant", "must be a name or an address, without port"),
        ("AXISWATCH_WBE__PORT", "1", 'no such setting: did you mean "AXISWATCH_WEB__..."'),
        ("AXISWATCH_ROBOT__NAME", "x", "no such setting"),
        ("AXISWATCH_WEB__PORT__X", "1", "unknown key"),
    ],
)
def test_problems_of_the_environment_name_the_variable(variable: str, value: str, words: str, file: Path) -> None:
    (message,) = messages(file, {variable: value})
    assert message.startswith(f"environment: {variable} = {value}: ")
    assert words in message


def test_files_of_the_web_stay_where_they_are_in_a_commissioned_configuration(tmp_path: Path) -> None:
    text = '[web]\ncertificate = "own.crt"\nkey = "/etc/own.key"\n' + BASE.replace("[web]\nport = 8080\n", "")
    web = tomllib.loads(relocated(text, tmp_path, tmp_path / "made"))["web"]
    found = [(tmp_path / "made" / web[key]).resolve() for key in ("certificate", "key")]
    assert found == [(tmp_path / "own.crt").resolve(), Path("/etc/own.key")]
