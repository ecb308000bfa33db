"""The face of the core: every name is there, and importing it loads nothing."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import monitor_core as mc

SOURCE = Path(mc.__file__).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", mc.__all__)
def test_each_name_is_documented_and_imported(name: str) -> None:
    assert getattr(mc, name) is not None
    assert name in (mc.__doc__ or "")


def test_types_are_those_of_the_imports() -> None:
    """What type checkers see is what programs get."""
    checked = {
        alias.asname or alias.name: (node.module, alias.name)
        for node in ast.walk(ast.parse(SOURCE))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("monitor_core.")
        for alias in node.names
    }
    assert sorted(checked) == sorted(mc.__all__)
    for name, (module, attribute) in checked.items():
        assert getattr(mc, name) is getattr(sys.modules[str(module)], attribute)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'axis_monitor_of'"):
        mc.axis_monitor_of  # noqa: B018


def test_the_import_alone_loads_no_library() -> None:
    code = "import sys, monitor_core; print({m.split('.')[0] for m in sys.modules} & {'numpy', 'numba', 'sympy'})"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip() == "set()"
