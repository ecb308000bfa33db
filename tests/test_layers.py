"""The layers hold: the engine stays pure, each outside library has one home, no machine's name leaks.

And no identifier is a word that does not say what it names.
"""

from __future__ import annotations

import ast
import re
import subprocess
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path
from types import CodeType

import pytest

from tests.conftest import ROOT

# --- monitor_core: arrays in, arrays out --------------------------------------------------------------

PURE = set(
    re.findall(
        r"\w+",
        """
        numpy scipy numba llvmlite operator monitor_core __future__ ast abc collections contextlib copy dataclasses
        difflib enum fractions functools heapq importlib itertools json math re types typing
        """,
    )
)
SYMBOLIC = {"pymoca"}  # in monitor_core/modeling only
IMPURE_CALLS = {"open", "print", "input", "exec", "eval", "__import__", "breakpoint"}

# --- service: one home for each library of the outside world ------------------------------------------

HOMES: dict[str, str | tuple[str, ...]] = {
    "can": "service/can/",
    "cantools": "service/can/",
    "asammdf": "service/can/",
    "canopen": "service/can/",
    "msgpack": "service/can/",
    "pyarrow": "service/ingest/",
    "sqlite3": "service/store/",
    "fastapi": "service/web/",
    "prometheus_client": "service/web/",
    "uvicorn": "service/web/",
    "httpx": ("service/client.py", "service/links/webhook.py"),
    "aiomqtt": "service/links/",
    "asyncua": "service/links/",
    "cryptography": ("service/links/", "service/config/certificates.py"),
    "smtplib": "service/links/",
    "matplotlib": "service/reports/",
}

# --- the repository: a path of one machine, or the host of a package registry --------------------------
# Put together from pieces, so that this file does not hold what it looks for.

_HOMES_OF_USERS = "|".join(["work", "home", "root", "Users"])
_REGISTRIES = ["pypi" + ".org", "python" + "hosted", "registry.npm" + "js", "deb.debian" + ".org"]
LEAK = re.compile(r"(?<![\w.~$})-])/(?:" + _HOMES_OF_USERS + ")/|" + "|".join(map(re.escape, _REGISTRIES)))


# --- names: these words do not say what a thing is -------------------------------------------------------

VAGUE = {"of", "one", "said", "told", "whole", "here"}


# --- one direction: each package imports only from those above it in its list ---------------------------

LAYERS = re.findall(
    r"\S+",
    """
    monitor_core.arrays monitor_core.wording monitor_core.samples monitor_core.kernel monitor_core.sampling
    monitor_core.drive
    monitor_core.modeling monitor_core.excitation
    monitor_core.settings monitor_core.trend
    monitor_core.detection monitor_core.monitoring monitor_core.identification
    monitor_core.calibration monitor_core
    service service.texts service.client service.can service.config service.ingest
    service.store service.pipeline
    service.web service.links service.reports service.simulation service.commands
    """,
)

INNER_LAYERS = {
    "service.config": """
        toml_lines unit_names problems schema bus_messages certificates drive_sources public_text schema_errors
        conditions drives axis_settings axis_detectors rules remarks epoch_values loading written
        """,
    "service.ingest": "roles_by_name tables samples records roles",
    "service.pipeline": """
        certificate_watch kernel_cache pauses axes persistence snapshot silence bus_readers publishing worker
        reconfiguration
        """,
}
"""The same inside a package: its folders, and its files beside these, each imports only from those before it."""


def python_files(folder: str) -> list[Path]:
    return sorted((ROOT / folder).rglob("*.py"))


def relative(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def nodes(source: str) -> Iterator[ast.AST]:
    return ast.walk(ast.parse(source))


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """The imports and calls of a file."""
    found = nodes(path.read_text(encoding="utf-8"))
    return tuple(node for node in found if isinstance(node, ast.Import | ast.ImportFrom | ast.Call))


def imports(found: Iterable[ast.AST], package: str) -> Iterator[tuple[int, str]]:
    """Line and absolute name of every import, wherever in the file it stands; package: where the file is."""
    for node in found:
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            yield node.lineno, ".".join([*above, *([node.module] if node.module else [])])


def imports_of(path: Path) -> Iterator[tuple[int, str]]:
    return imports(nodes_of(path), relative(path.parent).replace("/", "."))


def words_of(code: CodeType) -> Iterator[str]:
    """The names in compiled code, which takes a fourth of the time of its tree, and its texts."""
    yield from (*code.co_names, *code.co_varnames, *code.co_freevars, *code.co_cellvars)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from (constant.co_name, *words_of(constant))
        elif isinstance(constant, str):
            yield constant


def definitions(source: str) -> Iterator[tuple[int, str]]:
    """Line and name of each variable, argument, attribute, function, class and alias where it gets a vague name."""
    if VAGUE.isdisjoint(words_of(compile(source, "", "exec", dont_inherit=True))):
        return
    for node in nodes(source):
        yield from ((line, name) for line, name in names_of(node) if name in VAGUE)


def names_of(node: ast.AST) -> Iterator[tuple[int, str]]:
    match node:
        case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
            yield node.lineno, name
        case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
            yield node.lineno, node.name
        case ast.arg(arg=name) | ast.alias(asname=str(name)) | ast.ExceptHandler(name=str(name)):
            yield node.lineno, name
        case ast.MatchAs(name=str(name)) | ast.MatchStar(name=str(name)):
            yield node.lineno, name


def impurities(found: tuple[ast.AST, ...], package: str) -> Iterator[str]:
    allowed = PURE | (SYMBOLIC if f"{package}.".startswith("monitor_core.modeling.") else set())
    for line, name in imports(found, package):
        if name.split(".")[0] not in allowed:
            yield f"{line}: imports {name or 'from above its package'}"
    for node in found:
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in IMPURE_CALLS:
            yield f"{node.lineno}: calls {node.func.id}()"


def test_engine_is_pure() -> None:
    found = [
        f"{relative(path)}:{impurity}"
        for path in python_files("monitor_core")
        for impurity in impurities(nodes_of(path), relative(path.parent).replace("/", "."))
    ]
    assert found == []


def test_library_is_imported_only_at_home() -> None:
    strays = [
        f"{relative(path)}:{line}: imports {name}, whose home is {HOMES[name.split('.')[0]]}"
        for path in python_files("service")
        for line, name in imports_of(path)
        if not relative(path).startswith(HOMES.get(name.split(".")[0], ""))  # a text, or a tuple of them
    ]
    assert strays == []


def layer_of(module: str, parts: int = 2) -> str:
    """The first two parts of a module's name; the core's face, ``monitor_core`` itself, is a layer of its own."""
    return ".".join(module.split(".")[:parts])


def programs_in(path: Path) -> list[str]:
    """What is imported in texts, too, which other processes run as programs."""
    return re.findall(r"^ *(?:from|import) ([\w.]+)", path.read_text(encoding="utf-8"), re.MULTILINE)


def test_imports_go_one_way() -> None:
    """Those of the programs, too, that a file gives to other processes as texts."""
    edges = {
        (layer_of(relative(path)[: -len(".py")].replace("/", ".").removesuffix(".__init__")), layer_of(name))
        for folder in ("monitor_core", "service")
        for path in python_files(folder)
        for name in (*(name for _, name in imports_of(path)), *programs_in(path))
        if name.split(".")[0] in ("monitor_core", "service")
    }
    rank = {layer: place for place, layer in enumerate(LAYERS)}
    unlisted = {layer for edge in edges for layer in edge} - set(rank)
    assert unlisted == set()
    assert {(a, b) for a, b in edges if rank[a] < rank[b]} == set()


def file_graph() -> dict[str, set[str]]:
    """Of each module, those that it imports, wherever in the file that stands."""
    paths = [path for folder in ("monitor_core", "service") for path in python_files(folder)]
    names = {path: relative(path)[: -len(".py")].replace("/", ".").removesuffix(".__init__") for path in paths}
    modules = set(names.values())
    graph: dict[str, set[str]] = {}
    for path, name in names.items():
        found = graph.setdefault(name, set())
        for node in nodes_of(path):
            if isinstance(node, ast.ImportFrom):
                inner = {f"{node.module}.{alias.name}" for alias in node.names}
                found |= inner & modules if inner & modules else {node.module or ""} & modules
            elif isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names} & modules
    return graph


@pytest.mark.parametrize("package", INNER_LAYERS)
def test_imports_inside_a_package_go_one_way(package: str) -> None:
    layers = [*(f"{package}.{name}" for name in INNER_LAYERS[package].split()), package]  # the face is the last
    rank = {layer: place for place, layer in enumerate(layers)}
    parts = package.count(".") + 2
    inside = {module: found for module, found in file_graph().items() if layer_of(module, parts) in rank}
    others = {module for module in file_graph() if f"{module}.".startswith(f"{package}.")} - set(inside)
    assert others == set()
    edges = {
        (layer_of(module, parts), layer_of(name, parts))
        for module, found in inside.items()
        for name in found
        if f"{name}.".startswith(f"{package}.")
    }
    assert {(a, b) for a, b in edges if rank[a] < rank[b]} == set()


def test_no_files_import_each_other() -> None:
    """Not even inside a function or for types only."""
    tuple(TopologicalSorter(file_graph()).static_order())  # else a CycleError, with the circle


def test_no_two_modules_have_one_name() -> None:
    names = Counter(
        path.stem
        for folder in ("monitor_core", "service")
        for path in python_files(folder)
        if path.stem not in ("__init__", "__main__")
    )
    assert [name for name, count in names.items() if count > 1] == []


OPTION = re.compile(r"\b(typer\.|Query\(|Depends\(|Path\()")


def class_names(source: str) -> Iterator[str]:
    """Classes and public type aliases of a module.

    Left out: bodies of the API, which have the names of what they show, and options of commands and of requests.
    """
    for node in ast.parse(source).body:
        match node:
            case ast.ClassDef(name=name, bases=bases):
                if not {"Body", "models.Body"} & set(map(ast.unparse, bases)):
                    yield name
            case ast.Assign(targets=[ast.Name(id=name)], value=value) if name[0].isupper() and not name.isupper():
                if not OPTION.search(ast.unparse(value)):
                    yield name


def test_which_names_are_those_of_classes() -> None:
    own = "class A: pass\nclass _Gate: pass\nBus = int | None\nCan = Annotated[int, Field(ge=1)]\n"
    options = "Dbc = Annotated[int, typer.Option()]\nEds = Annotated[int, Query()]\n"
    others = "class Frame(Body): pass\n_Held = int\nMOST_FRAMES = 1\nvalue = 2\n"
    assert list(class_names(own + options + others)) == ["A", "_Gate", "Bus", "Can"]


def test_no_two_classes_have_one_name() -> None:
    names = Counter(
        name
        for folder in ("monitor_core", "service")
        for path in python_files(folder)
        for name in class_names(path.read_text(encoding="utf-8"))
    )
    assert [name for name, count in names.items() if count > 1] == []


HEAVY = {"monitor_core.modeling.modelica": "loads pymoca"}
"""Not on a face, since not every program that uses the package needs what it loads."""


def test_the_service_uses_the_faces_of_the_core() -> None:
    inner = {
        name
        for path in python_files("service")
        for _, name in imports_of(path)
        if name.startswith("monitor_core.") and name.count(".") > 1
    }
    assert inner == set(HEAVY)


def test_every_name_on_a_face_of_the_core_is_taken() -> None:
    """By a file outside of its package; a face that has functions of its own is none."""
    texts = {
        path: path.read_text(encoding="utf-8")
        for folder in ("monitor_core", "service")
        for path in python_files(folder)
    }
    left = set()
    faces = (path for path in python_files("monitor_core") if path.name == "__init__.py")
    for face in (path for path in faces if "def " not in texts[path]):
        package = relative(face.parent).replace("/", ".")
        names = {alias.name for node in nodes_of(face) if isinstance(node, ast.ImportFrom) for alias in node.names}
        parent, _, leaf = package.rpartition(".")
        taken = re.compile(rf"{re.escape(package)}\b|from {re.escape(parent)} import [^\n]*\b{leaf}\b")
        users = (text for path, text in texts.items() if face.parent not in path.parents and taken.search(text))
        left |= {f"{package}.{name}" for name in names - set(re.findall(r"\w+", " ".join(users)))}
    assert left == set()


RUN_AGAIN = {"tests/core/modeling/test_elimination_laws.py", "tests/core/excitation/test_figures.py"}
"""Of these files tests/soak runs the tests themselves, with more examples."""


def test_what_test_files_share_is_in_a_module_of_its_own() -> None:
    strays = [
        f"{relative(path)}:{node.lineno}: imports from {file}"
        for path in python_files("tests")
        for node in nodes_of(path)
        if isinstance(node, ast.ImportFrom)
        for name in (node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names))
        if (file := f"{name.replace('.', '/')}.py").rpartition("/")[2].startswith("test_")
        if (ROOT / file).exists() and file not in RUN_AGAIN
    ]
    assert strays == []


@pytest.mark.parametrize(
    ("source", "package", "impure"),
    [
        ("import numpy as np, math", "monitor_core", False),
        ("from .model import Model", "monitor_core", False),
        ("from ..model import Model", "monitor_core.modeling", False),
        ("from scipy.linalg import expm", "monitor_core", False),
        ("import pymoca", "monitor_core.modeling", False),
        ("from collections.abc import Iterator", "monitor_core", False),
        ("import pymoca", "monitor_core", True),
        ("from ..service import config", "monitor_core", True),
        ("from service import config", "monitor_core", True),
        ("def f():\n    import time", "monitor_core", True),
        ("import os.path", "monitor_core", True),
        ("print(1)", "monitor_core", True),
        ("with open('x') as f: pass", "monitor_core.modeling", True),
    ],
)
def test_the_purity_test_sees(source: str, package: str, impure: bool) -> None:
    assert bool(list(impurities(tuple(nodes(source)), package))) == impure


def test_names_say_what_a_thing_is() -> None:
    vague = [
        f"{relative(path)}:{line}: {name}"
        for folder in ("monitor_core", "service", "tests", "docs")
        for path in python_files(folder)
        for line, name in definitions(path.read_text(encoding="utf-8"))
    ]
    assert vague == []


@pytest.mark.parametrize(
    "source",
    [
        "one, *rest = 1, 2",
        "self.one = 1",
        "for one in (): pass",
        "[one for one in ()]",
        "(one := 1)",
        "with open('x') as one: pass",
        "lambda one: 1",
        "def f(*one): pass",
        "def one(): pass",
        "async def one(): pass",
        "class one: pass",
        "import numpy as one",
        "try: pass\nexcept OSError as one: pass",
        "match 1:\n    case one: pass",
        "match 1:\n    case [*one]: pass",
    ],
)
def test_the_test_of_names_sees(source: str) -> None:
    assert (source.count("\n") + 1, "one") in definitions(source)


def test_the_test_of_names_lets_words_and_uses_pass() -> None:
    assert list(definitions('f(one.whole, "told")  # said of it')) == []


def test_no_file_names_a_machine_or_a_registry(need: Callable[[str], str]) -> None:
    listing = subprocess.run(
        [need("git"), "-c", "safe.directory=*", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False
    )
    if listing.returncode:
        pytest.skip("not a git checkout")
    leaks = []
    for name in filter(None, listing.stdout.decode().split("\0")):
        try:
            text = (ROOT / name).read_text(encoding="utf-8")
        except (UnicodeDecodeError, FileNotFoundError, IsADirectoryError):
            continue  # a picture or a recording; deleted here but not yet in the index; a submodule
        for number, line in enumerate(text.splitlines(), 1):
            if found := LEAK.search(line):
                leaks.append(f"{name}:{number}: {found.group()}")
    assert leaks == []


@pytest.mark.parametrize(
    ("line", "leaks"),
    [
        ("cd " + "/wo" + "rk/main", True),
        ('"' + "/ho" + 'me/someone/x"', True),
        ("net/wo" + "rk/driver", False),
        ("docs/ho" + "me/index.html", False),
        ("https://files.python" + "hosted.x/y", True),
    ],
)
def test_the_leak_test_sees(line: str, leaks: bool) -> None:
    assert bool(LEAK.search(line)) == leaks
