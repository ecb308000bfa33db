"""[links]: schema of the plant links, which send alarms and states; each link is optional.

Secrets are never in the configuration: it names a file or an environment variable with the secret.
"""

import re
from ipaddress import ip_address
from typing import Annotated, Literal
from urllib.parse import urlsplit

from pydantic import AfterValidator, Field

from monitor_core.monitoring import PRIORITIES, Priority
from service.config.schema.base_table import FilePath, NonEmptyText, PlainName, Positive, Real, TomlTable, written

Port = Annotated[int, Field(strict=True, ge=1, le=65535)]
Variable = Annotated[str, written(r"[A-Za-z_][A-Za-z0-9_]*", "the name of a variable, such as AXISWATCH_PASSWORD")]
Topic = Annotated[str, written(r"[^+#/$\0\s][^+#/\0\s]*(/[^+#/\0\s]+)*", "a topic, such as plant/axiswatch")]
MailAddress = Annotated[str, written(r"[^@\s<>,;:\"]+@[^@\s<>,;:\"]+", "an address, such as anna@plant.example")]


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
    """Whether a host is a loopback name or address of this machine."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


class AlarmLimits(TomlTable):
    """Common keys of all links: which alarms a link delivers, and for how long it tries."""

    max_age_s: Annotated[Positive, Field(ge=60, le=2_592_000)] = 86400.0
    """a transition that could not be delivered for this time is given up [s]"""
    priorities: tuple[Priority, ...] = Field(PRIORITIES, min_length=1)
    """alarms of these priorities"""


class WebhookConfig(AlarmLimits):
    """[[links.webhook]]: sends each transition of an alarm, signed, to an address."""

    name: PlainName
    """name of the link: letters, digits, - and _"""
    url: Annotated[NonEmptyText, AfterValidator(_https)]
    """https://HOST/PATH; only the host is shown to users"""
    secret_file: FilePath | None = None
    """file whose text is the key of the signature, at least 16 characters"""
    secret_env: Variable | None = None
    """environment variable with that key; if it is set, the file is not read"""
    ca_file: FilePath | None = None
    """PEM file of the authority that has signed the receiver's certificate; default: the authorities of the system"""
    timeout_s: Positive = Field(10.0, le=120)
    """time in which the receiver must answer [s]"""


class ServerLink(AlarmLimits):
    """A link to a server to which the daemon logs in."""

    host: NonEmptyText
    """name or address of the server"""
    ca_file: FilePath | None = None
    """PEM file of the authority that has signed the server's certificate; default: the authorities of the system"""
    user: NonEmptyText | None = None
    """name by which the daemon logs in"""
    password_file: FilePath | None = None
    """file whose text is the password"""
    password_env: Variable | None = None
    """environment variable with the password; if it is set, the file is not read"""


class MqttConfig(ServerLink):
    """[links.mqtt]: publishes states of the axes and alarms to an MQTT 5 broker."""

    port: Port = 8883
    """TCP port of the broker"""
    tls: bool = Field(True, strict=True)
    """whether to use TLS; the certificate of the broker is verified"""
    prefix: Topic = "axiswatch"
    """first part of all topics; must differ between the daemons of a broker"""
    interval_s: Positive = Field(10.0, ge=1, le=3600)
    """time between two states of an axis [s]"""


class SmtpConfig(ServerLink):
    """[links.smtp]: sends an e-mail for each new alarm and for its end; several at a time share one e-mail."""

    port: Port = 587
    """TCP port of the mail server"""
    security: Literal["starttls", "tls", "none"] = "starttls"
    """"starttls", "tls" from the first byte, or "none", without a password and only on this machine"""
    sender: MailAddress
    """address of the sender"""
    to: tuple[MailAddress, ...] = Field(min_length=1, max_length=50)
    """addresses of the receivers"""
    priorities: tuple[Priority, ...] = Field(("medium", "high"), min_length=1)
    """alarms of these priorities"""
    collect_s: Real = Field(30.0, ge=0, le=3600)
    """delay of a message, in which causes of alarms are named and further alarms are added to it [s]"""
    interval_s: Real = Field(300.0, ge=0, le=86400)
    """shortest time between two messages; alarms in between are in the second [s]"""
    timeout_s: Positive = Field(30.0, le=120)
    """time in which the server must answer [s]"""


class OpcUaConfig(AlarmLimits):
    """[links.opcua]: an OPC UA server with the axes as nodes and the alarms as conditions."""

    host: NonEmptyText = "127.0.0.1"
    """address to listen on; any but 127.0.0.1, such as 0.0.0.0 for all interfaces, needs a certificate"""
    port: Port = 4840
    """TCP port to listen on"""
    certificate: FilePath | None = None
    """PEM file of the certificate of an RSA key; with it, all communication is signed and encrypted"""
    key: FilePath | None = None
    """PEM file of the private key of the certificate, without a password"""
    anonymous: bool = Field(False, strict=True)
    """clients without a token may read, but not change anything"""
    interval_s: Positive = Field(1.0, ge=0.2, le=3600)
    """time between two updates of changed values [s]"""


class LinksConfig(TomlTable):
    """[links]: the plant links, to which alarms and states are sent."""

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
"""Keys of a link that name files."""
SECRET_KEYS = ("password", "secret", "token")


def concealed(key: str | int, value: object) -> object:
    """The value of a key for messages, without a secret that was written there by mistake."""
    if key in SECRET_KEYS:
        return "..."
    return re.sub(r"//[^/]*@", "//...@", value) if key == "url" and isinstance(value, str) else value
