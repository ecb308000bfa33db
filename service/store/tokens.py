"""Tokens of those who may use the API: their names, what they may do, and SHA-256 of each secret.

A secret is 256 random bits.  Nobody can guess or list so many, so one round of SHA-256 hides it: slow hashes with
a salt (scrypt, Argon2) are for passwords, which people choose, and would cost each request a tenth of a second.
"""

import fcntl
import hashlib
import hmac
import json
import os
import re
import secrets
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path

from service.store.database import StoreError

TOKENS_FILE = "tokens.json"
"""In the state directory."""
PREFIX = "axw_"
"""Every secret begins so: programs that look for secrets in files and logs find it."""
NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")
LOCAL, ANYONE, NOBODY = "local", "anyone", "nobody"
"""Names of callers without a token; no token has one of them."""

_SECRET_BYTES = 32
_FORMAT = 1


class Scope(StrEnum):
    """What a caller may do; each scope includes those before it."""

    READ = "read"
    OPERATE = "operate"
    ADMIN = "admin"

    @property
    def included(self) -> frozenset["Scope"]:
        """The scope itself, and those that it includes."""
        every = list(Scope)
        return frozenset(every[: every.index(self) + 1])


@dataclass(frozen=True, slots=True)
class Caller:
    """Who asks, and what that name may do."""

    name: str
    scopes: frozenset[Scope]


@dataclass(frozen=True, slots=True)
class Token:
    """A token without its secret."""

    name: str
    scope: Scope
    sha256: str
    """of the secret, in hexadecimal digits"""
    created: str
    """ISO 8601, UTC"""


class NameTakenError(Exception):
    """There is a token of that name already."""


class NoSuchTokenError(Exception):
    """There is no token of that name; ``known`` are those that there are."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        super().__init__(f"there is no token {name!r}")
        self.known = tuple(known)


class TokenFile:
    """The file of the tokens: read again as soon as it has changed, written as a whole."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._seen: tuple[int, ...] | None = None
        self._tokens: tuple[Token, ...] = ()

    @property
    def exists(self) -> bool:
        """Whether there is such a file; it may hold no token."""
        return self.path.exists()

    def tokens(self) -> tuple[Token, ...]:
        """Those in force now, in the order in which they were made; none where there is no file.

        Raises:
            StoreError: the file cannot be read, is damaged, or others than its owner may write it.
        """
        try:
            with self.path.open(encoding="utf-8") as file:
                now = os.fstat(file.fileno())
                # Written as a whole, so a new inode; a change by hand shows in its time or size.
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
        """Whose secret this is; None: nobody's.  Takes the same time wherever they differ.

        Raises:
            StoreError: as of ``tokens``.
        """
        given, found = _digest(secret), None
        for token in self.tokens():
            if hmac.compare_digest(given, token.sha256):
                found = token
        return None if found is None else Caller(found.name, found.scope.included)

    def new(self, name: str, scope: Scope) -> str:
        """Make a token; its secret, which is kept nowhere.

        Raises:
            NameTakenError: that name has one.
            StoreError: the file cannot be read or written.
        """
        secret = PREFIX + secrets.token_urlsafe(_SECRET_BYTES)
        created = datetime.now(UTC).isoformat(timespec="seconds")
        with self._changing():
            tokens = self.tokens()
            if name in (token.name for token in tokens):
                raise NameTakenError(
                    f"there is a token {name!r} already; revoke it first, or choose another name"
                )
            self._write([*tokens, Token(name, scope, _digest(secret), created)])
        return secret

    def revoke(self, name: str) -> int:
        """Remove a token; the number of those that are left.

        Raises:
            NoSuchTokenError: that name has none.
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
        """Only one change at a time: a lock on the folder, which ends with the process."""
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
        """Replace the file at once, for its owner alone; written by root, it belongs to the folder's owner."""
        entries = [
            {"name": t.name, "scope": str(t.scope), "sha256": t.sha256, "created": t.created} for t in tokens
        ]
        number, name = tempfile.mkstemp(prefix=f"{self.path.name}.", dir=self.path.parent)  # mode 0600
        try:
            with os.fdopen(number, "w", encoding="utf-8") as file:
                json.dump({"format": _FORMAT, "tokens": entries}, file, indent=1)
                file.write("\n")
                file.flush()
                if os.geteuid() == 0:
                    owner = self.path.parent.stat()
                    os.fchown(file.fileno(), owner.st_uid, owner.st_gid)
                os.fsync(file.fileno())
            os.replace(name, self.path)
        except BaseException:
            os.unlink(name)
            raise


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
