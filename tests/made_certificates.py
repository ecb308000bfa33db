"""Certificates for a server on this machine, made by openssl."""

import subprocess
from pathlib import Path


def made_certificate(openssl: str, file: Path, days: int, more: str = "rsa:2048") -> Path:
    """A certificate of its own that expires in so many days from now, with its key beside it in ``.key``."""
    words = [openssl, "req", "-x509", "-newkey", more, "-nodes", "-subj", "/CN=localhost", "-days", str(days)]
    words += ["-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1", "-keyout", str(file.with_suffix(".key"))]
    subprocess.run([*words, "-out", str(file)], check=True, capture_output=True)
    return file
