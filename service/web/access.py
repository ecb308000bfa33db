"""Access to the API: callers, scopes, and the scope that a route needs.

A route declares it by ``who: Operator`` or ``who: Admin``, the name of the caller.
"""

from collections.abc import Callable, Iterable
from typing import Annotated

from fastapi import Depends, Request, Security
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from monitor_core.wording import sentence
from service.store.tokens import ANYONE, LOCAL, Caller, Scope, TokenFile

__all__ = ["Access", "Admin", "ForbiddenError", "IsAdmin", "Operator", "Scope", "UnprotectedError", "needs"]

_BEARER = HTTPBearer(
    auto_error=False,
    scheme_name="token",
    description="a token of `axiswatch token new`; not needed where the daemon listens on 127.0.0.1 and has no tokens",
)
_THIS_MACHINE = ("localhost", "127.0.0.1", "::1")
_EVERY_ADDRESS = ("0.0.0.0", "::")


class UnprotectedError(Exception):
    """Other machines could reach the daemon without tokens or TLS; the text says what to do."""


class ForbiddenError(Exception):
    """The caller is known, but its scope is too small; the text says which scope is needed."""


def needs(scope: Scope) -> Callable[..., str]:
    """A dependency for routes: checks that the caller has this scope; returns the name of the caller.

    Raises:
        ForbiddenError: the caller's scope is smaller; answered with 403.
    """

    def who(
        request: Request,
        _documented: Annotated[HTTPAuthorizationCredentials | None, Security(_BEARER)] = None,
    ) -> str:
        caller: Caller = request.state.caller  # set by the gate
        if scope not in caller.scopes:
            words = "this needs a token with the scope {scope}; that of {name} is smaller"
            raise ForbiddenError(sentence("scope", words, scope=scope, name=caller.name))
        return caller.name

    return who


def _is_admin(request: Request) -> bool:
    """Whether the caller may see addresses and folders; a dependency for routes that leave these out for others."""
    caller: Caller = request.state.caller
    return Scope.ADMIN in caller.scopes


Operator = Annotated[str, Depends(needs(Scope.OPERATE))]
Admin = Annotated[str, Depends(needs(Scope.ADMIN))]
IsAdmin = Annotated[bool, Depends(_is_admin)]


class Access:
    """Checks the host names of requests, and identifies callers by their tokens.

    Args:
        tokens: the token file; None: there are no tokens.
        hosts: names and addresses of the daemon, besides those of the loopback interface.
        remote: whether other machines can reach the address.
        tls: whether the connection is encrypted.
        insecure: whether to accept other machines without tokens or TLS.
        open_metrics: whether /metrics needs no token.

    Raises:
        UnprotectedError: other machines can reach the address, tokens or TLS are missing, and ``insecure`` is false.
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
        """Replace the names, and whether /metrics needs no token; from any thread."""
        self.open_metrics = open_metrics
        self._hosts = {*_THIS_MACHINE, *(host.lower() for host in hosts)} - {*_EVERY_ADDRESS}

    def known_host(self, host: str) -> bool:
        """Whether this name or address, without a port, is one of the daemon."""
        return host.lower().rstrip(".") in self._hosts

    @property
    def needs_token(self) -> bool:
        """Whether a caller must have a token; stays true until the next start once a token file has existed."""
        self._needed = self._needed or (self._tokens is not None and self._tokens.exists)
        return self._needed

    def caller(self, secret: str | None) -> Caller | None:
        """The caller with this secret; None: unknown.

        Raises:
            StoreError: the tokens cannot be read.
        """
        if not self.needs_token:
            return Caller(ANYONE if self._remote else LOCAL, Scope.ADMIN.included)
        return self._tokens.caller(secret) if self._tokens is not None and secret is not None else None

    @property
    def danger(self) -> str | None:
        """A warning for everyone who sees the page that the daemon is not protected; None: it is."""
        if not self._remote or (self._tls and self.needs_token):
            return None
        if not self.needs_token:
            words = "insecure: everyone whose machine reaches this address may read and operate, without a token"
            if self._tls:
                return sentence("no token", words)
            more = "; what is sent can be read and changed on the way (no TLS)"
            return sentence("no token, no TLS", words + more)
        return sentence("no TLS", "insecure: what is sent, tokens too, can be read and changed on the way (no TLS)")


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
