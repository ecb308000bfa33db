"""When certificates expire, as openssl sees it, and what is said before that."""

import subprocess
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest

from service.config import load
from service.config.certificates import WARNED_S, Expiry, expires_us, expiries
from service.texts.instants import microseconds, now_us
from tests.conftest import ROOT
from tests.end_to_end.processes import demo_config, edit
from tests.made_certificates import made_certificate
from tests.service.command_line import shown

LOCALHOST = ROOT / "tests" / "tls" / "localhost.crt"


def end_by_openssl(openssl: str, file: Path) -> int | None:
    found = subprocess.run([openssl, "x509", "-in", str(file), "-noout", "-enddate"], check=True, capture_output=True)
    text = found.stdout.decode().strip().removeprefix("notAfter=")
    return microseconds(datetime.strptime(text, "%b %d %H:%M:%S %Y GMT").replace(tzinfo=UTC))


@pytest.mark.parametrize(
    ("days", "kind"),
    [(1, "rsa:2048"), (20, "rsa:4096"), (20_000, "rsa:2048"), (100_000, "rsa:2048")],
    ids=["a day", "a long key", "after 2050", "after 2200"],
)
def test_the_end_is_that_of_openssl(tmp_path: Path, need: Callable[[str], str], days: int, kind: str) -> None:
    """Times until 2049 have two digits of the year, later ones four."""
    file = made_certificate(need("openssl"), tmp_path / "cell.crt", days, kind)
    assert expires_us(file.read_text(encoding="ascii")) == end_by_openssl(need("openssl"), file)


def test_the_end_of_an_expired_one(need: Callable[[str], str]) -> None:
    expired = LOCALHOST.with_name("expired.crt")
    at_us = expires_us(expired.read_text(encoding="ascii"))
    assert at_us == end_by_openssl(need("openssl"), expired) == 1_767_225_600_000_000
    warning = Expiry("web", expired, at_us).warning(now_us())
    assert warning is not None
    assert "has expired at 2026-01-01T00:00:00.000000Z" in warning


def test_of_a_chain_the_first_end_counts(tmp_path: Path, need: Callable[[str], str]) -> None:
    soon = made_certificate(need("openssl"), tmp_path / "soon.crt", 20)
    chain = LOCALHOST.read_text(encoding="ascii") + "issued by\n" + soon.read_text(encoding="ascii")
    assert expires_us(chain) == end_by_openssl(need("openssl"), soon)


_PEM = LOCALHOST.read_text(encoding="ascii")


@pytest.mark.parametrize(
    "text",
    ["", "no certificate", "\n".join(_PEM.splitlines()[:2] + _PEM.splitlines()[-1:]), _PEM.replace("MII", "!!!", 1)],
    ids=["empty", "text", "cut", "no base64"],
)
def test_what_is_no_certificate_is_a_value_error(text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        expires_us(text)


def test_it_is_reported_from_thirty_days_before_its_end() -> None:
    web, opcua = (Expiry(use, Path("/etc/axiswatch/cell.crt"), 1_800_000_000_000_000) for use in ("web", "opcua"))
    begin_us = web.at_us - round(WARNED_S * 1e6)
    assert web.warning(begin_us - 1) is None
    expires = web.warning(begin_us)
    assert expires == (
        "cell.crt, the certificate of [web], expires at 2027-01-15T08:00:00.000000Z. Put a new one in its place and"
        " reload axiswatch (SIGHUP)"
    )
    assert web.warning(web.at_us - 1) == expires
    assert opcua.warning(web.at_us) == (
        "cell.crt, the certificate of [links.opcua], has expired at 2027-01-15T08:00:00.000000Z: clients refuse the"
        " connection. Put a new one in its place and restart axiswatch"
    )


def test_check_notes_the_certificates_of_all_servers(tmp_path: Path, need: Callable[[str], str]) -> None:
    for name, days in (("web", 29), ("opcua", 31)):
        made_certificate(need("openssl"), tmp_path / f"{name}.crt", days)
    tables = "".join(
        f'[{t}]\ncertificate = "{n}.crt"\nkey = "{n}.key"\n' for t, n in (("web",) * 2, ("links.opcua", "opcua"))
    )
    file = edit(demo_config(tmp_path, axes=1), ("[[bus]]", f"{tables}\n[[bus]]"))
    found = [(expiry.use, round((expiry.at_us - now_us()) / 86.4e9)) for expiry in expiries(load(file, {}))]
    assert found == [("web", 29), ("opcua", 31)]
    words = shown("check", "--config", file)
    assert "Note: web.crt, the certificate of [web], expires at" in words
    assert "opcua.crt" not in words
    (tmp_path / "web.crt").unlink()
    assert [expiry.use for expiry in expiries(load(file, {}))] == ["opcua"]
