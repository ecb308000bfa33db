"""[links]: where else the alarms and states go; each link is optional.  Its keys, and what must fit together in them.

Secrets are never in the configuration: it names a file or a variable of the environment that holds them.
"""

import re
from collections.abc import Iterator
from importlib.util import find_spec
from ipaddress import ip_address
from typing import Annotated, Any, Literal
from urllib.parse import urlsplit

from pydantic import AfterValidator, Field

from monitor_core.monitoring import PRIORITIES, Priority
from service.config.base_table import FilePath, Name, Positive, Real, Table, Text, written
from service.config.problems import Finding
from service.config.toml_lines import Keys

Port = Annotated[int, Field(strict=True, ge=1, le=65535)]
Variable = Annotated[
    str, written(r"[A-Za-z_][A-Za-z0-9_]*", "the name of a variable, such as AXISWATCH_PASSWORD")
]
Topic = Annotated[str, written(r"[^+#/$\0\s][^+#/\0\s]*(/[^+#/\0\s]+)*", "a topic, such as plant/axiswatch")]
MailAddress = Annotated[
    str, written(r"[^@\s<>,;:\"]+@[^@\s<>,;:\"]+", "an address, such as anna@plant.example")
]


def _https(url: str) -> str:
    try:
        parts = urlsplit(url)
        host, _ = parts.hostname, parts.port
    except ValueError:
        host = None
    if host is None or parts.scheme not in ("http", "https") or parts.username is not None:
        raise ValueError("must be https://HOST/PATH, without a user or a password")
    if parts.scheme == "http" and not is_local(host):
        raise ValueError("must begin with https://; only on this machine http:// is possible")
    return url


def is_local(host: str) -> bool:
    """Whether a host is a name or an address of this machine alone."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


class AlarmLimits(Table):
    """Of every link: which alarms it delivers, and for how long it tries."""

    max_age_s: Annotated[Positive, Field(ge=60, le=2_592_000)] = 86400.0
    """what could not be delivered for this time is given up [s]"""
    priorities: tuple[Priority, ...] = Field(PRIORITIES, min_length=1)
    """alarms of these priorities"""


class WebhookConfig(AlarmLimits):
    """[[links.webhook]]: each transition of an alarm is sent to an address, signed."""

    name: Name
    """name of the link: letters, digits, - and _"""
    url: Annotated[Text, AfterValidator(_https)]
    """https://HOST/PATH; of it only the host is shown"""
    secret_file: FilePath | None = None
    """file whose text is the key of the signature, at least 16 characters"""
    secret_env: Variable | None = None
    """variable of the environment with that key; where it is set, the file is not read"""
    ca_file: FilePath | None = None
    """PEM file of the authority that has signed the receiver's certificate; default: the known ones"""
    timeout_s: Positive = Field(10.0, le=120)
    """time in which the receiver must answer [s]"""


class ServerLink(AlarmLimits):
    """A link to a server at which the daemon logs in."""

    host: Text
    """name or address of the server"""
    ca_file: FilePath | None = None
    """PEM file of the authority that has signed the server's certificate; default: the known ones"""
    user: Text | None = None
    """name by which the daemon logs in"""
    password_file: FilePath | None = None
    """file whose text is the password"""
    password_env: Variable | None = None
    """variable of the environment with the password; where it is set, the file is not read"""


class MqttConfig(ServerLink):
    """[links.mqtt]: states of the axes and alarms to a broker, MQTT 5."""

    port: Port = 8883
    """TCP port of the broker"""
    tls: bool = Field(True, strict=True)
    """whether the broker speaks TLS; its certificate is verified"""
    prefix: Topic = "axiswatch"
    """beginning of all topics; another one for each daemon at the broker"""
    interval_s: Positive = Field(10.0, ge=1, le=3600)
    """time between two states of an axis [s]"""


class SmtpConfig(ServerLink):
    """[links.smtp]: a message for each new alarm and for its end; many at a time are one message."""

    port: Port = 587
    """TCP port of the mail server"""
    security: Literal["starttls", "tls", "none"] = "starttls"
    """"starttls", "tls" from the first byte, or "none", without a password and only on this machine"""
    sender: MailAddress
    """address of the sender"""
    to: tuple[MailAddress, ...] = Field(min_length=1, max_length=50)
    """addresses of those who get the messages"""
    priorities: tuple[Priority, ...] = Field(("medium", "high"), min_length=1)
    """alarms of these priorities"""
    collect_s: Real = Field(30.0, ge=0, le=3600)
    """a message waits for this time, in which alarms get their names and others join it [s]"""
    interval_s: Real = Field(300.0, ge=0, le=86400)
    """shortest time between two messages; what comes meanwhile is in the second [s]"""
    timeout_s: Positive = Field(30.0, le=120)
    """time in which the server must answer [s]"""


class OpcUaConfig(AlarmLimits):
    """[links.opcua]: an OPC UA server with the axes as nodes and the alarms as conditions."""

    host: Text = "127.0.0.1"
    """address to listen on; any but 127.0.0.1, such as 0.0.0.0 for all interfaces, needs a certificate"""
    port: Port = 4840
    """TCP port to listen on"""
    certificate: FilePath | None = None
    """PEM file of the certificate, of an RSA key; with it everything is signed and encrypted"""
    key: FilePath | None = None
    """PEM file of the private key of the certificate, without a password"""
    anonymous: bool = Field(False, strict=True)
    """who has no token may read, and change nothing"""
    interval_s: Positive = Field(1.0, ge=0.2, le=3600)
    """time between two looks for values that have changed [s]"""


class LinksConfig(Table):
    """[links]: where else the alarms go."""

    webhook: tuple[WebhookConfig, ...] = ()
    """receivers of alarms over HTTPS, [[links.webhook]]"""
    mqtt: MqttConfig | None = None
    """a broker, [links.mqtt]"""
    smtp: SmtpConfig | None = None
    """a mail server, [links.smtp]"""
    opcua: OpcUaConfig | None = None
    """an OPC UA server, [links.opcua]"""

    @property
    def any(self) -> bool:
        """Whether there is any link."""
        return bool(self.names)

    @property
    def names(self) -> list[str]:
        """The names of all links."""
        alone = {"mqtt": self.mqtt, "smtp": self.smtp, "opcua": self.opcua}
        return [
            *(hook.name for hook in self.webhook),
            *(name for name, link in alone.items() if link is not None),
        ]


SECRET_FILES = ("secret_file", "password_file")
LINK_FILES = (*SECRET_FILES, "ca_file", "certificate", "key")
"""Keys of the files that a link names."""
SECRET_KEYS = ("password", "secret", "token")


def concealed(key: str | int, value: object) -> object:
    """The value of a key as a message may show it: where a secret is by mistake, it is left out."""
    if key in SECRET_KEYS:
        return "..."
    return re.sub(r"//[^/]*@", "//...@", value) if key == "url" and isinstance(value, str) else value


# --- Cross-checks: names, secrets, encryption, and whether the program can do it at all -------------------------------


RESERVED = ("mqtt", "smtp", "opcua")
"""Names of the links that have no name of their own."""


def link_names(links: LinksConfig) -> Iterator[Finding]:
    """Each link has a name of its own: status and metrics are shown by it."""
    first: dict[str, Keys] = {}
    for i, hook in enumerate(links.webhook):
        path: Keys = ("webhook", i, "name")
        if hook.name in RESERVED:
            yield Finding(path, f"is the name of [links.{hook.name}]: choose another one")
        elif (taken := first.setdefault(hook.name, path)) != path:
            yield Finding(path, "must differ from the name of", taken[:-1])


def link_secrets(links: LinksConfig) -> Iterator[Finding]:
    """A secret has a source.  Whether it can be read is seen at the start: not everyone who checks this may."""
    for i, hook in enumerate(links.webhook):
        if hook.secret_file is None and hook.secret_env is None:
            message = "missing: give secret_file or secret_env, the key of the signature"
            yield Finding(("webhook", i, "secret_file"), message)
    for name, link in (("mqtt", links.mqtt), ("smtp", links.smtp)):
        if link is None:
            continue
        given = link.password_file is not None or link.password_env is not None
        if given and link.user is None:
            yield Finding((name, "user"), "missing: it is needed with a password")
        elif link.user is not None and not given:
            message = "missing: give password_file or password_env with user"
            yield Finding((name, "password_file"), message)


def link_encryption(links: LinksConfig) -> Iterator[Finding]:
    """A password crosses no network in the clear, and neither do messages; OPC UA is encrypted for other machines."""
    mqtt, smtp, opcua = links.mqtt, links.smtp, links.opcua
    if mqtt is not None and not mqtt.tls and mqtt.user is not None and not is_local(mqtt.host):
        yield Finding(("mqtt", "tls"), "the password would cross the network in the clear: use TLS")
    if smtp is not None and smtp.security == "none" and (smtp.user is not None or not is_local(smtp.host)):
        message = 'is possible only to this machine and without user: use "starttls" or "tls"'
        yield Finding(("smtp", "security"), message)
    if opcua is not None and not is_local(opcua.host) and opcua.certificate is None and opcua.key is None:
        message = 'other machines reach this host: give certificate and key, or host = "127.0.0.1"'
        yield Finding(("opcua", "host"), message)


def link_extras(links: LinksConfig) -> Iterator[Finding]:
    """What a link needs is installed."""
    for name, package in (("mqtt", "aiomqtt"), ("opcua", "asyncua")):
        if getattr(links, name) is not None and find_spec(package) is None:
            yield Finding((name,), f"needs another package: pip install axiswatch[{name}]")


def certificate_and_key(table: Any) -> Iterator[Finding]:
    """A certificate has its key, of [web] or [links.opcua]; None: there is no such table.

    Whether they fit is seen at the start: not everyone who reads this may read the key.
    """
    for given, lacking in (("certificate", "key"), ("key", "certificate")):
        if getattr(table, given, None) is not None and getattr(table, lacking) is None:
            yield Finding((lacking,), f"missing: it belongs to {given}")


LINK_RULES = (link_names, link_secrets, link_encryption, link_extras)
