"""Tokens: what is kept of them, what they allow, and that a change holds at once."""

import json
import os
import stat
from pathlib import Path

import pytest

from service.store.archive import state_files
from service.store.database import StoreError
from service.store.tokens import NameTakenError, NoSuchTokenError, Scope, TokenFile


@pytest.fixture
def file(tmp_path: Path) -> TokenFile:
    return TokenFile(tmp_path / "state" / "tokens.json")


def names(file: TokenFile) -> list[str]:
    return [token.name for token in file.tokens()]


def test_a_secret_names_its_caller_and_is_kept_nowhere(file: TokenFile) -> None:
    anna, ben = file.new("anna", Scope.OPERATE), file.new("ben", Scope.READ)
    found = file.caller(anna)
    assert found is not None
    assert (found.name, sorted(found.scopes)) == ("anna", ["operate", "read"])
    assert file.caller(ben) == TokenFile(file.path).caller(ben)
    for wrong in ("", "axw_", anna[:-1], anna + "A", anna.lower(), ben[:-1] + "\udcff"):
        assert file.caller(wrong) is None
    kept = file.path.read_text(encoding="utf-8")
    assert anna.removeprefix("axw_") not in kept
    assert stat.S_IMODE(file.path.stat().st_mode) == 0o600
    assert [path.name for path in file.path.parent.iterdir()] == ["tokens.json"]
    assert len(anna) == len("axw_") + 43  # 32 bytes, six bits a letter


def test_a_backup_does_not_see_a_file_that_is_being_written(file: TokenFile, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a process that is killed there, it stays."""
    seen = list[list[str]]()
    monkeypatch.setattr(os, "fsync", lambda _: seen.append([*state_files(file.path.parent)]))
    file.new("anna", Scope.READ)
    file.new("ben", Scope.READ)
    assert seen == [[], ["tokens.json"]]


def test_a_change_by_another_process_holds_at_once(file: TokenFile) -> None:
    other = TokenFile(file.path)
    anna, ben = other.new("anna", Scope.READ), other.new("ben", Scope.READ)
    assert (file.caller(anna), file.caller(ben)) != (None, None)
    assert other.revoke("anna") == 1
    assert file.caller(anna) is None
    assert file.caller(ben) is not None
    file.path.unlink()
    assert file.caller(ben) is None
    assert not file.exists


def test_a_name_has_one_token(file: TokenFile) -> None:
    file.new("anna", Scope.READ)
    with pytest.raises(NameTakenError, match="anna"):
        file.new("anna", Scope.ADMIN)
    with pytest.raises(NoSuchTokenError, match="ben") as error:
        file.revoke("ben")
    assert error.value.known == ("anna",)
    assert names(file) == ["anna"]
    assert file.revoke("anna") == 0
    assert file.exists  # so that nobody is let in by it


@pytest.mark.parametrize(
    "change",
    [
        {"format": 2},
        {"tokens": [{"name": "anna"}]},
        {"tokens": [{"name": "a b", "scope": "read", "sha256": "0" * 64, "created": ""}]},
        {"tokens": [{"name": "anna", "scope": "root", "sha256": "0" * 64, "created": ""}]},
        {"tokens": [{"name": "anna", "scope": "read", "sha256": "", "created": ""}]},
        {"tokens": 3},
    ],
)
def test_a_damaged_file_lets_nobody_in(change: dict[str, object], file: TokenFile) -> None:
    """Not even those whom it let in before."""
    secret = file.new("anna", Scope.READ)
    assert file.caller(secret) is not None
    content = json.loads(file.path.read_text(encoding="utf-8"))
    file.path.write_text(json.dumps(content | change), encoding="utf-8")
    for _ in range(2):
        with pytest.raises(StoreError, match=r"tokens\.json: this is no file of tokens"):
            file.caller(secret)


def test_a_file_that_others_may_write_is_not_believed(file: TokenFile) -> None:
    secret = file.new("anna", Scope.READ)
    assert file.caller(secret) is not None
    file.path.chmod(0o620)
    with pytest.raises(StoreError, match="others may write this file: chmod 600"):
        file.caller(secret)


def test_a_folder_that_is_none(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("", encoding="utf-8")
    with pytest.raises(StoreError, match="state"):
        TokenFile(tmp_path / "state" / "tokens.json").new("anna", Scope.READ)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
def test_written_by_root_it_belongs_to_the_owner_of_the_folder(file: TokenFile) -> None:
    file.path.parent.mkdir()
    os.chown(file.path.parent, 12345, 12346)
    file.new("anna", Scope.READ)
    assert (file.path.stat().st_uid, file.path.stat().st_gid) == (12345, 12346)
