"""Cross-checks of the plant links: names, secrets, encryption, installed packages; certificates with their keys."""

from collections.abc import Iterator
from importlib.util import find_spec
from typing import Any

from service.config.problems import CheckFinding
from service.config.schema import LinksConfig, is_local
from service.config.toml_lines import Keys

RESERVED = ("mqtt", "smtp", "opcua")
"""Names of the links that cannot be named by the user."""


def link_names(links: LinksConfig) -> Iterator[CheckFinding]:
    """Each link has a unique name, which status and metrics use."""
    first: dict[str, Keys] = {}
    for i, hook in enumerate(links.webhook):
        path: Keys = ("webhook", i, "name")
        if hook.name in RESERVED:
            yield CheckFinding(path, f"is the name of [links.{hook.name}]: choose another one")
        elif (taken := first.setdefault(hook.name, path)) != path:
            yield CheckFinding(path, "must differ from the name of", taken[:-1])


def link_secrets(links: LinksConfig) -> Iterator[CheckFinding]:
    """A secret has a source.

    The start checks whether it can be read, as a user who checks the file may not be allowed.
    """
    for i, hook in enumerate(links.webhook):
        if hook.secret_file is None and hook.secret_env is None:
            message = "missing: give secret_file or secret_env, the key of the signature"
            yield CheckFinding(("webhook", i, "secret_file"), message)
    for name, link in (("mqtt", links.mqtt), ("smtp", links.smtp)):
        if link is None:
            continue
        given = link.password_file is not None or link.password_env is not None
        if given and link.user is None:
            yield CheckFinding((name, "user"), "missing: it is needed with a password")
        elif link.user is not None and not given:
            message = "missing: give password_file or password_env with user"
            yield CheckFinding((name, "password_file"), message)


def link_encryption(links: LinksConfig) -> Iterator[CheckFinding]:
    """Passwords and messages cross no network unencrypted; OPC UA is encrypted for other machines."""
    mqtt, smtp, opcua = links.mqtt, links.smtp, links.opcua
    if mqtt is not None and not mqtt.tls and mqtt.user is not None and not is_local(mqtt.host):
        yield CheckFinding(("mqtt", "tls"), "the password would cross the network in the clear: use TLS")
    if smtp is not None and smtp.security == "none" and (smtp.user is not None or not is_local(smtp.host)):
        message = 'is possible only to this machine and without user: use "starttls" or "tls"'
        yield CheckFinding(("smtp", "security"), message)
    if opcua is not None and not is_local(opcua.host) and opcua.certificate is None and opcua.key is None:
        message = 'other machines reach this host: give certificate and key, or host = "127.0.0.1"'
        yield CheckFinding(("opcua", "host"), message)


def link_extras(links: LinksConfig) -> Iterator[CheckFinding]:
    """The packages that a link needs are installed."""
    for name, package in (("mqtt", "aiomqtt"), ("opcua", "asyncua")):
        if getattr(links, name) is not None and find_spec(package) is None:
            yield CheckFinding((name,), f"needs another package: pip install axiswatch[{name}]")


def certificate_and_key(table: Any) -> Iterator[CheckFinding]:
    """A certificate in [web] or [links.opcua] has its key; ``table`` None: the table does not exist.

    The start checks whether they fit, as a user who checks the file may not be allowed to read the key.
    """
    for given, lacking in (("certificate", "key"), ("key", "certificate")):
        if getattr(table, given, None) is not None and getattr(table, lacking) is None:
            yield CheckFinding((lacking,), f"missing: it belongs to {given}")


LINK_RULES = (link_names, link_secrets, link_encryption, link_extras)
