"""When the certificates that a configuration names expire, and the warnings before and after that.

The date is read from the DER structure of X.509 (RFC 5280, 4.1), as Python's ssl shows only certificates of others.
"""

import re
import ssl
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal, NamedTuple

from monitor_core.wording import Sentence, sentence
from service.config.schema import Config
from service.texts.instants import iso, microseconds

CertificateUse = Literal["web", "opcua"]
"""The server that shows a certificate to its clients"""

WARNED_S = 30 * 86400.0
"""A certificate that expires within this time is reported [s]."""

_PEM = re.compile(r"-----BEGIN CERTIFICATE-----.+?-----END CERTIFICATE-----", re.DOTALL)
_SEQUENCE, _VERSION, _UTC_TIME, _GENERALIZED_TIME = 0x30, 0xA0, 0x17, 0x18
_VALIDITY = 3
"""Place of the validity after the version, which is optional: serial number, algorithm, issuer, validity"""
_TABLES: dict[CertificateUse, str] = {"web": "[web]", "opcua": "[links.opcua]"}


class Expiry(NamedTuple):
    """The end of a certificate.

    ``at_us``: when the first certificate of the file expires, which may be one of its chain [us since 1970].
    """

    use: CertificateUse
    file: Path
    at_us: int

    def warning(self, now_us: int) -> Sentence | None:
        """The warning of a certificate that expires soon, or has; None: there is time."""
        if (self.at_us - now_us) / 1e6 > WARNED_S:
            return None
        # The server of OPC UA reads its certificate when it starts.
        then = sentence("certificate reload", "reload axiswatch (SIGHUP)")
        if self.use == "opcua":
            then = sentence("certificate restart", "restart axiswatch")
        words = "{file}, the certificate of {table}, expires at {at}. Put a new one in its place and {then}"
        expired = self.at_us <= now_us
        if expired:
            words = words.replace("expires at {at}.", "has expired at {at}: clients refuse the connection.")
        return sentence(
            "certificate expired" if expired else "certificate expires",
            words,
            file=self.file.name,
            table=_TABLES[self.use],
            at=iso(self.at_us),
            then=then,
        )


def expiries(config: Config) -> Iterator[Expiry]:
    """When the certificates of the servers expire; a file that cannot be read or used is reported elsewhere."""
    opcua = config.links.opcua
    files: dict[CertificateUse, Path | None] = {
        "web": config.web.certificate,
        "opcua": None if opcua is None else opcua.certificate,
    }
    for use, file in files.items():
        if file is None:
            continue
        try:
            yield Expiry(use, file, expires_us(file.read_text(encoding="ascii", errors="replace")))
        except (OSError, ValueError):
            continue


def expires_us(pem: str) -> int:
    """When the first of the certificates in a PEM text expires [us since 1970].

    Raises:
        ValueError: there is none, or it has no such date.
    """
    return min(_expires_us(ssl.PEM_cert_to_DER_cert(found)) for found in _PEM.findall(pem))


def _expires_us(der: bytes) -> int:
    try:
        ((_, certificate),) = _elements(der)
        signed = next(_elements(certificate))[1]
        fields = [element for element in _elements(signed) if element[0] != _VERSION]
        kind, validity = fields[_VALIDITY]
        _, (time_kind, text) = _elements(validity)
    except (IndexError, StopIteration) as error:
        raise ValueError("this is no certificate") from error
    if kind != _SEQUENCE or time_kind not in (_UTC_TIME, _GENERALIZED_TIME):
        raise ValueError("this is no certificate: its validity is missing")
    moment = text.decode("ascii")
    if time_kind == _UTC_TIME:  # two digits of the year
        moment = ("19" if moment >= "50" else "20") + moment
    found = microseconds(datetime.strptime(moment, "%Y%m%d%H%M%SZ").replace(tzinfo=UTC))
    assert found is not None
    return found


def _elements(der: bytes) -> Iterator[tuple[int, bytes]]:
    """The elements of DER, one after the other: tag and content."""
    at = 0
    while at < len(der):
        tag, length, at = der[at], der[at + 1], at + 2
        if length & 0x80:  # the length has several bytes, and this is their number
            size = length & 0x7F
            length, at = int.from_bytes(der[at : at + size]), at + size
        yield tag, der[at : at + length]
        at += length
