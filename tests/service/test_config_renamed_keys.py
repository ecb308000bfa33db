"""Keys of earlier versions are errors that name the new key, with file and line."""

from pathlib import Path

import pytest

from service.config import ConfigErrors, load
from service.config.found_file import FoundFileError
from service.config.nominal_file import read_nominal
from service.config.validation_messages import RENAMED_KEYS, hint
from tests.service.config_texts import BASE, CONFIG, furnish

EXAMPLE = (CONFIG / "axiswatch.toml").read_text(encoding="utf-8")
SECTION = {
    "averaged": "[robot.axis.angle]",
    "least_excitation": "[robot.axis.estimator]",
    "least_information": "[robot.axis.estimator]",
    "least_speed": "[[robot.axis]]",
    "maximum_gap_s": "[[robot.axis]]",
    "speed_noise": "[robot.axis.estimator]",
    "varying": "[robot.axis.model]",
    "widening": "[robot.axis.detector]",
    "wraps_at": "[robot.axis.angle]",
}


@pytest.mark.parametrize("key", SECTION)
def test_an_old_key_names_the_new_one(key: str, tmp_path: Path) -> None:
    furnish(tmp_path)
    header = SECTION[key]
    text = BASE if header in BASE else f"{BASE}\n{header}\n"
    at = text.index(header) + len(header)
    file = tmp_path / "a.toml"
    file.write_text(f"{text[:at]}\n{key} = 1\n{text[at:]}", encoding="utf-8")
    with pytest.raises(ConfigErrors) as caught:
        load(file, {})
    problem = next(p for p in caught.value.problems if p.key.endswith(key))
    assert (problem.line, problem.message) == (text[:at].count("\n") + 2, hint(key))


@pytest.mark.parametrize("key", RENAMED_KEYS.values())
def test_the_new_keys_exist(key: str) -> None:
    assert f"{key} = " in EXAMPLE or f".{key}]]" in EXAMPLE


def test_a_parameter_may_have_the_name_of_an_old_key(tmp_path: Path) -> None:
    """What is wrong with this file is something else."""
    (tmp_path / "nominal.toml").write_text("format = 1\n[values]\naveraged = 1.0\n", encoding="utf-8")
    with pytest.raises(FoundFileError, match="required"):
        read_nominal(tmp_path / "nominal.toml")
