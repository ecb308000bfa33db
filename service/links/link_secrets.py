"""Reads secrets and certificates of links at the start; no message, log or configuration shows a secret."""

import os
import ssl
from collections.abc import Mapping
from pathlib import Path

MIN_KEY_CHARACTERS = 16
"""Shortest key of a signature; it is random, not a word to remember."""


class LinkSecretError(Exception):
    """A secret or a certificate cannot be used; the text names the file or the variable and says why."""


def secret(file: Path | None, variable: str | None, environ: Mapping[str, str] = os.environ) -> str | None:
    """The secret from an environment variable, otherwise from a file without its last line break; None: neither given.

    Raises:
        LinkSecretError: the variable or the file has no usable text.
    """
    if variable is not None and (text := environ.get(variable)):
        return text
    if file is None and variable is None:
        return None
    if file is None:
        raise LinkSecretError(f"the variable {variable} of the environment has no text: it must hold the secret")
    try:
        text = file.read_text(encoding="utf-8").rstrip("\r\n")
    except OSError as error:
        raise LinkSecretError(f"{file}: cannot read the secret: {error.strerror}") from None
    except UnicodeDecodeError:
        raise LinkSecretError(f"{file}: the secret must be UTF-8 text") from None
    if not text or "\n" in text or "\0" in text:
        raise LinkSecretError(f"{file}: must hold one line, the secret")
    return text


def key(file: Path | None, variable: str | None, environ: Mapping[str, str] = os.environ) -> bytes:
    """The key of a signature.

    Raises:
        LinkSecretError: there is no key, or it is too short.
    """
    text = secret(file, variable, environ)
    if text is None or len(text) < MIN_KEY_CHARACTERS:
        source = variable if file is None else file
        raise LinkSecretError(
            f"{source}: the key of the signature must have at least {MIN_KEY_CHARACTERS} characters;"
            " `openssl rand -hex 32` prints a good one"
        )
    return text.encode("utf-8")


def tls(ca_file: Path | None) -> ssl.SSLContext:
    """A TLS context that verifies certificates, with the authorities of the system, or with that of a file.

    Raises:
        LinkSecretError: the file has no certificate.
    """
    try:
        return ssl.create_default_context(cafile=None if ca_file is None else str(ca_file))
    except ssl.SSLError:
        raise LinkSecretError(f"{ca_file}: holds no PEM certificate of an authority") from None
    except OSError as error:
        raise LinkSecretError(f"{ca_file}: cannot read the certificate: {error.strerror}") from None
