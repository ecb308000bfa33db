"""Certificates, tokens and secrets: what the daemon needs to admit clients and to reach its links."""

from collections.abc import Callable, Iterator
from functools import partial

from service.config import Config
from service.config.schema import LinksConfig, WebConfig
from service.links.link_secrets import LinkSecretError, key, secret, tls
from service.store.database import StoreError
from service.store.tokens import TOKENS_FILE, TokenFile
from service.web.access import Access, UnprotectedError
from service.web.server import CannotListenError, Certificate, CertificateError, is_remote


def certificate_of(web: WebConfig) -> Certificate | None:
    """The certificate of the web server; None: no TLS.

    Raises:
        CertificateError: the certificate cannot be used.
    """
    if web.certificate is None or web.key is None:
        return None
    certificate = Certificate(web.certificate, web.key)
    certificate.check()
    return certificate


def access_of(config: Config, insecure: bool) -> Access:
    """The rules for access to the daemon.

    Raises:
        UnprotectedError: other machines can reach the daemon, and tokens or TLS are missing.
        StoreError: the tokens cannot be read.
        CannotListenError: the host is not an address.
    """
    web = config.web
    return Access(
        TokenFile(config.service.state_dir / TOKENS_FILE),
        [web.host, *web.hosts],
        remote=is_remote(web.host),
        tls=web.certificate is not None,
        insecure=insecure,
        open_metrics=web.open_metrics,
    )


def obstacles(config: Config) -> Iterator[str]:
    """Reasons why the daemon could not start on this machine as this user, in words."""
    try:
        certificate_of(config.web)
        access_of(config, insecure=False)
    except (CertificateError, UnprotectedError, StoreError, CannotListenError) as error:
        yield str(error)
    for look in looks(config.links):
        try:
            look()
        except LinkSecretError as error:
            yield str(error)


def looks(links: LinksConfig) -> Iterator[Callable[[], object]]:
    """Readers of the secrets of all links; each raises LinkSecretError."""
    for hook in links.webhook:
        yield partial(key, hook.secret_file, hook.secret_env)
        yield partial(tls, hook.ca_file)
    for link in (links.mqtt, links.smtp):
        if link is not None:
            yield partial(secret, link.password_file, link.password_env)
            yield partial(tls, link.ca_file)
