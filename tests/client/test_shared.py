"""What of the grader leaves the house with the client: it imports NumPy and MuJoCo alone, and holds nothing secret."""

import ast
import json
import re
import runpy
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from support.sites import ROOT

CLIENT = ROOT / "client"
SETUP: dict[str, Any] = runpy.run_path(str(CLIENT / "setup.py"), run_name="setup")
SHARED: tuple[str, ...] = SETUP["SHARED"]
GRADER = ROOT / "src" / "grader"
OWN = sorted((CLIENT / "src" / "mjgrader").glob("*.py"))
ALLOWED = {"numpy", "mujoco", *sys.stdlib_module_names}
NEWER = re.compile(
    r"\b(StrEnum|tomllib|assert_never|ExceptionGroup|BaseExceptionGroup|Self|reveal_type|from datetime import UTC)\b"
)
"""What Python 3.10 does not have."""


def list_imports(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0
            yield from [f"{node.module}.{name.name}" for name in node.names]
        elif isinstance(node, ast.Import):
            yield from [name.name for name in node.names]


def is_shared(name: str) -> bool:
    """Whether `grader.a.b`, or `grader.a.b.name`, is of a module that is shared."""
    parts = name.split(".")[1:]
    return any("/".join(parts[:length]) + ".py" in SHARED for length in range(1, len(parts) + 1))


@pytest.mark.parametrize("name", SHARED)
def test_a_shared_module_imports_numpy_mujoco_and_shared_modules_alone(name: str) -> None:
    for imported in list_imports(GRADER / name):
        top = imported.partition(".")[0]
        assert is_shared(imported) if top == "grader" else top in ALLOWED, imported


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.name)
def test_the_client_imports_nothing_else_of_the_grader(path: Path) -> None:
    for imported in list_imports(path):
        top = imported.partition(".")[0]
        assert is_shared(imported) if top == "grader" else top in {*ALLOWED, "mjgrader", "httpx", "IPython"}, imported


@pytest.mark.parametrize(
    "path", [*OWN, *(GRADER / name for name in SHARED)], ids=lambda path: f"{path.parent.name}/{path.name}"
)
def test_it_is_python_3_10(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    ast.parse(text, feature_version=(3, 10))
    assert not NEWER.search(text)


def test_nothing_in_it_is_of_the_content() -> None:
    whole = "\n".join((GRADER / name).read_text(encoding="utf-8") for name in SHARED)
    for path in (ROOT / "quizzes").glob("*.json"):
        for question in json.loads(path.read_text()).get("questions", []):
            texts = [question.get("explain", ""), *question.get("check", {}).get("numbers", {})]
            for case in question.get("check", {}).get("cases", []):
                texts += [case.get("hint", ""), case.get("x-why", ""), *case.get("xml", [])]
            for text in texts:
                assert len(text) < 12 or text.strip()[:60] not in whole, text


def test_what_is_packed_is_what_the_server_runs() -> None:
    """Comments, docstrings and types of functions are left out; the code is the same."""
    packed = SETUP["list_packed"]()
    assert {name for name, text in packed.items() if text} == {*SHARED}
    for name in SHARED:
        ours = compile(SETUP["strip"](SETUP["rename"]((GRADER / name).read_text(encoding="utf-8"))), name, "exec")
        assert compile(packed[name], name, "exec").co_code == ours.co_code
        assert "grader.exercises" not in packed[name].replace("mjgrader.shared.exercises", "")
