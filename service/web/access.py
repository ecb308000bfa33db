"""Who may use the API, and what a route needs: ``who: Annotated[str, Depends(needs(Scope.OPERATE))]``."""

from collections.abc import Callable, Iterable
from typing import Annotated

from fastapi import Request, Security
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from monitor_core.wording import sentence
from service.store.tokens import ANYONE, LOCAL, Caller, Scope, TokenFile

__all__ = ["Access", "Caller", "ForbiddenError", "Scope", "UnprotectedError", "needs"]

_BEARER = HTTPBearer(
    auto_error=False,
    scheme_name="token",
    description="a token of `axiswatch token new`; not needed where the daemon listens on 127.0.0.1 and has no tokens",
)
_THIS_MACHINE = ("localhost", "127.0.0.1", "::1")
_EVERY_ADDRESS = ("0.0.0.0", "::")


class UnprotectedError(Exception):
    """Other machines would reach the daemon without tokens or without TLS; the text says what would be right."""


class ForbiddenError(Exception):
    """The caller is known, but may not do this; the text says what it would need."""


def needs(scope: Scope) -> Callable[..., str]:
    """A dependency of routes: the name of the caller, who has this scope.

    Raises:
        ForbiddenError: the caller has a smaller one; answered with 403.
    """

    def who(
        request: Request,
        _documented: Annotated[HTTPAuthorizationCredentials | None, Security(_BEARER)] = None,
    ) -> str:
        caller: Caller = request.state.caller  # set by the gate, which every request passes
        if scope not in caller.scopes:
            words = "this needs a token with the scope {scope}; that of {name} is smaller"
            raise ForbiddenError(sentence("scope", words, scope=scope, name=caller.name))
        return caller.name

    return who


class Access:
    """By which names the daemon is asked, and who may ask.

    Args:
        tokens: None: there can be none.
        hosts: names and addresses of the daemon, beside those of this machine itself.
        remote: other machines reach the address that it listens on.
        tls: what is sent is encrypted.
        insecure: it may lack tokens or TLS where other machines reach it.
        open_metrics: /metrics needs no token.

    Raises:
        UnprotectedError: it lacks them, and may not.
        StoreError: the tokens cannot be read.
    """

    def __init__(
        self,
        tokens: TokenFile | None = None,
        hosts: Iterable[str] = (),
        *,
        remote: bool = False,
        tls: bool = False,
        insecure: bool = False,
        open_metrics: bool = False,
    ) -> None:
        self._tokens, self._remote, self._tls = tokens, remote, tls
        self.change(hosts, open_metrics)
        has_tokens = tokens is not None and bool(tokens.tokens())
        if remote and not insecure and not (has_tokens and tls):
            raise UnprotectedError(_unprotected(has_tokens, tls))
        self._needed = remote and not insecure

    def change(self, hosts: Iterable[str], open_metrics: bool) -> None:
        """Have these names, and tell its metrics to everyone or not; from any thread."""
        self.open_metrics = open_metrics
        self._hosts = {*_THIS_MACHINE, *(host.lower() for host in hosts)} - {*_EVERY_ADDRESS}

    def known_host(self, host: str) -> bool:
        """Whether the daemon has this name or address, without a port."""
        return host.lower().rstrip(".") in self._hosts

    @property
    def needs_token(self) -> bool:
        """Whether a caller must have a token: once there was a file of tokens, until the next start."""
        self._needed = self._needed or (self._tokens is not None and self._tokens.exists)
        return self._needed

    def caller(self, secret: str | None) -> Caller | None:
        """Who asks with this secret; None: nobody who is known.

        Raises:
            StoreError: the tokens cannot be read.
        """
        if not self.needs_token:
            return Caller(ANYONE if self._remote else LOCAL, Scope.ADMIN.included)
        return self._tokens.caller(secret) if self._tokens is not None and secret is not None else None

    @property
    def danger(self) -> str | None:
        """What everyone should know who sees the page; None: nothing."""
        if not self._remote or (self._tls and self.needs_token):
            return None
        if not self.needs_token:
            words = (
                "insecure: everyone whose machine reaches this address may read and operate, without a token"
            )
            if self._tls:
                return sentence("no token", words)
            more = "; what is sent can be read and changed on the way (no TLS)"
            return sentence("no token, no TLS", words + more)
        return sentence(
            "no TLS", "insecure: what is sent, tokens too, can be read and changed on the way (no TLS)"
        )


def _unprotected(has_tokens: bool, tls: bool) -> str:
    lacking = []
    if not has_tokens:
        lacking.append("a token (axiswatch token new NAME --scope read)")
    if not tls:
        lacking.append("certificate and key in [web], for TLS")
    return (
        f"other machines reach this host of [web], which needs {' and '.join(lacking)}; or --insecure in a network"
        ' that you trust; or host = "127.0.0.1", for this machine only'
    )
