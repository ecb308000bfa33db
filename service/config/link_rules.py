"""Cross-checks of [links] and [web]: names, secrets, encryption, and whether the program can do it at all."""

from collections.abc import Iterator
from importlib.util import find_spec

from service.config.problems import Finding
from service.config.schema import Config
from service.config.schema_links import ServerLink, is_local
from service.config.toml_lines import Keys

RESERVED = ("mqtt", "smtp", "opcua")
"""Names of the links that have no name of their own."""


def link_names(config: Config) -> Iterator[Finding]:
    """Each link has a name of its own: status and metrics are shown by it."""
    first: dict[str, Keys] = {}
    for i, hook in enumerate(config.links.webhook):
        path: Keys = ("links", "webhook", i, "name")
        if hook.name in RESERVED:
            yield Finding(path, f"is the name of [links.{hook.name}]: choose another one")
        elif (taken := first.setdefault(hook.name, path)) != path:
            yield Finding(path, "must differ from the name of", taken[:-1])


def link_secrets(config: Config) -> Iterator[Finding]:
    """A secret has a source.  Whether it can be read is seen at the start: not everyone who checks this may."""
    for i, hook in enumerate(config.links.webhook):
        path: Keys = ("links", "webhook", i, "secret_file")
        if hook.secret_file is None and hook.secret_env is None:
            yield Finding(path, "missing: give secret_file or secret_env, the key of the signature")
    for name, link in (("mqtt", config.links.mqtt), ("smtp", config.links.smtp)):
        if link is not None:
            yield from (finding.inside(("links", name)) for finding in _login(link))


def _login(link: ServerLink) -> Iterator[Finding]:
    given = link.password_file is not None or link.password_env is not None
    if given and link.user is None:
        yield Finding(("user",), "missing: it is needed with a password")
    elif link.user is not None and not given:
        yield Finding(("password_file",), "missing: give password_file or password_env with user")


def link_encryption(config: Config) -> Iterator[Finding]:
    """A password crosses no network in the clear, and neither do messages."""
    mqtt, smtp = config.links.mqtt, config.links.smtp
    if mqtt is not None and not mqtt.tls and mqtt.user is not None and not is_local(mqtt.host):
        yield Finding(("links", "mqtt", "tls"), "the password would cross the network in the clear: use TLS")
    if smtp is not None and smtp.security == "none" and (smtp.user is not None or not is_local(smtp.host)):
        message = 'is possible only without user and to this machine: use "starttls" or "tls"'
        yield Finding(("links", "smtp", "security"), message)


def certificates(config: Config) -> Iterator[Finding]:
    """A certificate has its key, and other machines reach OPC UA only by encrypted connections.

    Whether they fit is seen at the start: not everyone who reads this may read the key.
    """
    opcua, path = config.links.opcua, ("links", "opcua")
    for where, table in ((("web",), config.web), (path, opcua)):
        for given, lacking in (("certificate", "key"), ("key", "certificate")):
            if getattr(table, given, None) is not None and getattr(table, lacking) is None:
                yield Finding((*where, lacking), f"missing: it belongs to {given}")
    if opcua is not None and not is_local(opcua.host) and opcua.certificate is None and opcua.key is None:
        message = 'other machines reach this host: give certificate and key, or host = "127.0.0.1"'
        yield Finding((*path, "host"), message)


def link_extras(config: Config) -> Iterator[Finding]:
    """What a link needs is installed."""
    for name, package in (("mqtt", "aiomqtt"), ("opcua", "asyncua")):
        if getattr(config.links, name) is not None and find_spec(package) is None:
            yield Finding(("links", name), f"needs another package: pip install axiswatch[{name}]")


LINK_RULES = (link_names, link_secrets, link_encryption, certificates, link_extras)
