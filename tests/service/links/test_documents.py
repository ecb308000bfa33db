"""The links of docs/operation.md load as they are shown; what a link lacks is named."""

import re
from pathlib import Path

import pytest

from service.config import ConfigErrors, load
from service.config.schema import LinksConfig
from tests.conftest import ROOT
from tests.service.config.config_texts import LINKS as LINKS_TEXT
from tests.service.config.config_texts import TABLES

TEXT = (ROOT / "docs" / "operation.md").read_text(encoding="utf-8")
LINKS = TEXT[TEXT.index("## Links") : TEXT.index("## State of a parameter")]
EXAMPLES = re.findall(r"```toml\n(.*?)```", LINKS, re.DOTALL)


def test_every_link_has_an_example() -> None:
    kinds = [re.findall(r"^\[+links\.(\w+)\]", example, re.MULTILINE) for example in EXAMPLES]
    assert sorted(kind for found in kinds for kind in found) == sorted(LinksConfig.model_fields)


@pytest.mark.parametrize("example", EXAMPLES)
def test_examples_load(example: str, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(TABLES + example, encoding="utf-8")
    assert load(tmp_path / "a.toml", {}).links.any


def test_a_link_whose_package_is_missing_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.config.rules.link_rules.find_spec", lambda _name: None)
    (tmp_path / "a.toml").write_text(TABLES + LINKS_TEXT, encoding="utf-8")
    with pytest.raises(ConfigErrors) as caught:
        load(tmp_path / "a.toml", {})
    lines = (TABLES + LINKS_TEXT).splitlines()
    for name, problem in zip(("mqtt", "opcua"), caught.value.problems, strict=True):
        assert (problem.line, problem.key) == (lines.index(f"[links.{name}]") + 1, f"links.{name}")
        assert f"pip install axiswatch[{name}]" in problem.message
