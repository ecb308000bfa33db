"""When the certificates that a configuration names expire, and the warnings before and after that."""

from collections.abc import Iterator
from pathlib import Path
from typing import Literal, NamedTuple

from monitor_core.wording import Sentence, sentence
from service.config.schema import Config
from service.texts.instants import iso, microseconds

CertificateUse = Literal["web", "opcua"]
"""The server that shows a certificate to its clients"""

WARNED_S = 30 * 86400.0
"""A certificate that expires within this time is reported [s]."""

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
        ValueError: there is none, or it cannot be read.
    """
    # Not at the top: the import takes a third of a second, and few configurations have a certificate.
    from cryptography import x509

    ends = (microseconds(found.not_valid_after_utc) for found in x509.load_pem_x509_certificates(pem.encode()))
    return min(end for end in ends if end is not None)
