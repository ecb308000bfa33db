"""Which certificates a reload replaces: those that the servers then have."""

from collections.abc import Callable
from pathlib import Path

from structlog.testing import capture_logs

from service.config import load
from service.pipeline.certificate_watch import CertificateWatch
from service.texts.instants import now_us
from tests.end_to_end.processes import demo_config, edit
from tests.made_certificates import made_certificate

TABLES = """\
[web]
certificate = "web.crt"
key = "web.key"
[links.opcua]
certificate = "opcua.crt"
key = "opcua.key"

[[bus]]"""


def test_links_that_are_not_changed_keep_the_certificate_that_they_have(
    tmp_path: Path, need: Callable[[str], str]
) -> None:
    def make(days: int) -> None:
        for name in ("web", "opcua"):
            made_certificate(need("openssl"), tmp_path / f"{name}.crt", days)

    def days() -> dict[str, int]:
        return {expiry.use: round((expiry.at_us - now_us()) / 86.4e9) for expiry in watch.expiries}

    make(20)
    file = edit(demo_config(tmp_path, axes=1), ("[[bus]]", TABLES))
    watch = CertificateWatch(load(file, {}))
    assert days() == {"web": 20, "opcua": 20}
    make(100)
    watch.reloaded(load(file, {}))
    assert days() == {"web": 100, "opcua": 20}
    with capture_logs() as logs:
        (words,) = watch.warnings(now_us())
        assert watch.warnings(now_us()) == [words]
    assert "opcua.crt" in words
    assert [entry["message"] for entry in logs] == [words]
    edit(file, ("[links.opcua]\n", "[links.opcua]\ninterval_s = 2.0\n"))
    watch.reloaded(load(file, {}))
    assert days() == {"web": 100, "opcua": 100}
    assert watch.warnings(now_us()) == []
