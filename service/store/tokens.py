"""Access tokens for the API: name, scope and SHA-256 of the secret of each.

A secret has 256 random bits, too many to guess, so one round of SHA-256 is enough to hide it.  Slow hashes with a salt
(scrypt, Argon2) are for passwords chosen by people, and would add a tenth of a second to each request.
"""

import fcntl
import hashlib
import hmac
import json
import os
import re
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path

from service.store.database import StoreError
from service.store.private_file import replacing

TOKENS_FILE = "tokens.json"
"""Name of the file in the state directory."""
PREFIX = "axw_"
"""Start of every secret, so that secret scanners find one in files and logs."""
NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")
LOCAL, ANYONE, NOBODY = "local", "anyone", "nobody"
"""Names of callers without a token; no token may have these names."""

_SECRET_BYTES = 32
_FORMAT = 1


class Scope(StrEnum):
    """The permissions of a caller; each scope includes those before it."""

    READ = "read"
    OPERATE = "operate"
    ADMIN = "admin"

    @property
    def included(self) -> frozenset["Scope"]:
        """The scope itself and the scopes that it includes."""
        every = list(Scope)
        return frozenset(every[: every.index(self) + 1])


@dataclass(frozen=True, slots=True)
class Caller:
    """The author of a request, and the scopes of that caller."""

    name: str
    scopes: frozenset[Scope]


@dataclass(frozen=True, slots=True)
class Token:
    """A token without its secret."""

    name: str
    scope: Scope
    sha256: str
    """SHA-256 of the secret in hexadecimal digits"""
    created: str
    """ISO 8601, UTC"""


class NameTakenError(Exception):
    """A token with this name exists already."""


class NoSuchTokenError(Exception):
    """There is no token with this name; ``known``: the existing names."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        super().__init__(f"there is no token {name!r}")
        self.known = tuple(known)


class TokenFile:
    """The token file: read again whenever it has changed, and always written as a whole."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._seen: tuple[int, ...] | None = None
        self._tokens: tuple[Token, ...] = ()

    @property
    def exists(self) -> bool:
        """Whether the file exists; it may have no tokens."""
        return self.path.exists()

    def tokens(self) -> tuple[Token, ...]:
        """The present tokens in the order in which they were made; none if there is no file.

        Raises:
            StoreError: the file cannot be read, is damaged, or may be written by others than its owner.
        """
        try:
            with self.path.open(encoding="utf-8") as file:
                now = os.fstat(file.fileno())
                # A new file has a new inode; a change by hand shows in the time or size.
                mark = (now.st_ino, now.st_mtime_ns, now.st_size, now.st_mode)
                if mark != self._seen:
                    if now.st_mode & 0o022:
                        raise StoreError(f"{self.path}: others may write this file: chmod 600 {self.path}")
                    self._tokens, self._seen = tuple(_parsed(file.read())), mark
        except FileNotFoundError:
            self._tokens, self._seen = (), None
        except OSError as error:
            raise StoreError(f"{self.path}: {error.strerror}") from error
        except (ValueError, KeyError, TypeError) as error:
            raise StoreError(f"{self.path}: this is no file of tokens ({error})") from error
        return self._tokens

    def caller(self, secret: str) -> Caller | None:
        """The caller with this secret; None: no token has it.  The comparison takes constant time.

        Raises:
            StoreError: as of ``tokens``.
        """
        given, found = _digest(secret), None
        for token in self.tokens():
            if hmac.compare_digest(given, token.sha256):
                found = token
        return None if found is None else Caller(found.name, found.scope.included)

    def new(self, name: str, scope: Scope) -> str:
        """Make a token; returns its secret, which is not stored anywhere.

        Raises:
            NameTakenError: a token with this name exists.
            StoreError: the file cannot be read or written.
        """
        secret = PREFIX + secrets.token_urlsafe(_SECRET_BYTES)
        created = datetime.now(UTC).isoformat(timespec="seconds")
        with self._changing():
            tokens = self.tokens()
            if name in (token.name for token in tokens):
                raise NameTakenError(f"there is a token {name!r} already; revoke it first, or choose another name")
            self._write([*tokens, Token(name, scope, _digest(secret), created)])
        return secret

    def revoke(self, name: str) -> int:
        """Remove a token; returns the number of remaining tokens.

        Raises:
            NoSuchTokenError: no token has this name.
            StoreError: the file cannot be read or written.
        """
        with self._changing():
            tokens = self.tokens()
            left = [token for token in tokens if token.name != name]
            if len(left) == len(tokens):
                raise NoSuchTokenError(name, [token.name for token in tokens])
            self._write(left)
        return len(left)

    @contextmanager
    def _changing(self) -> Iterator[None]:
        """Allow one change at a time, by a lock on the folder, which ends with the process."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            folder = os.open(self.path.parent, os.O_RDONLY)
            try:
                fcntl.flock(folder, fcntl.LOCK_EX)
                yield
            finally:
                os.close(folder)
        except OSError as error:
            raise StoreError(f"{self.path}: {error.strerror}") from error

    def _write(self, tokens: Iterable[Token]) -> None:
        """Replace the file; only its owner may read it.  If root writes it, it gets the owner of the folder."""
        entries = [{"name": t.name, "scope": str(t.scope), "sha256": t.sha256, "created": t.created} for t in tokens]
        text = json.dumps({"format": _FORMAT, "tokens": entries}, indent=1) + "\n"
        with replacing(self.path) as file:
            file.write(text.encode())
            if os.geteuid() == 0:
                owner = self.path.parent.stat()
                os.fchown(file.fileno(), owner.st_uid, owner.st_gid)


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode("utf-8", "surrogateescape")).hexdigest()


def _parsed(text: str) -> Iterator[Token]:
    content = json.loads(text)
    if content["format"] != _FORMAT:
        raise ValueError(f"its format is {content['format']}, this version reads {_FORMAT}")
    for entry in content["tokens"]:
        name, sha256 = str(entry["name"]), str(entry["sha256"])
        if not NAME.fullmatch(name) or not re.fullmatch("[0-9a-f]{64}", sha256):
            raise ValueError(f"the entry {name!r} is damaged")
        yield Token(name, Scope(entry["scope"]), sha256, str(entry["created"]))
