"""The script that is made of the cells of a notebook: complete, in order, and without what it does not need."""

import json
from typing import Any

import pytest

from mjgrader.assembling import assemble
from mjgrader.errors import Sentence
from mjgrader.sources import name_function, refuse_other_code


def run(source: str) -> dict[str, Any]:
    names: dict[str, Any] = {"__name__": "script"}
    exec(source, names)
    return names


def test_helpers_imports_and_constants_come_along_and_nothing_else() -> None:
    cells = [
        "import numpy as np\nimport math\nimport os",
        "LIMIT = 3.0\nprint('hello')\nplot = [1, 2]",
        "def helper(x):\n    return np.sqrt(x) + LIMIT",
        "def entry(x):\n    return helper(x)",
        "entry(4)",
    ]
    source = assemble(cells, "entry")
    assert run(source)["entry"](4) == 5
    for missing in ("os", "math", "hello", "plot"):
        assert missing not in source


def test_the_newest_definition_counts() -> None:
    cells = ["def entry():\n    return size()", "def size():\n    return 1", "def size():\n    return 2"]
    source = assemble(cells, "entry")
    assert run(source)["entry"]() == 2
    assert source.count("def size") == 1


def test_what_a_name_builds_on_and_what_changes_it_stays_in_order() -> None:
    cells = [
        "table = {}", "table['a'] = 1", "scale = 2", "scale += 3", "scale = scale * 10",
        "def entry():\n    return table['a'] * scale", "table['a'] = 7",
    ]  # fmt: skip
    assert run(assemble(cells, "entry"))["entry"]() == 7 * 50


def test_decorators_classes_and_defaults_come_along() -> None:
    cells = [
        "from functools import lru_cache\nfrom dataclasses import dataclass",
        "@dataclass\nclass Point:\n    x: float\n    def twice(self):\n        return 2 * self.x",
        "START = 4",
        "@lru_cache\ndef entry(at=START):\n    return Point(at).twice()",
    ]
    assert run(assemble(cells, "entry"))["entry"]() == 8


def test_the_program_part_magics_and_this_client_are_left_out() -> None:
    cells = [
        "import mjgrader as g\nfrom mjgrader import check",
        "get_ipython().run_line_magic('pip', 'install x')",
        "def entry():\n    return 1\n\nif __name__ == '__main__':\n    entry()",
        "this is no python",
    ]
    assert assemble(cells, "entry") == "def entry():\n    return 1\n"


def test_star_imports_come_along() -> None:
    cells = ["from math import *\nfrom mjgrader import *", "def entry(x):\n    return sqrt(x) + pi"]
    source = assemble(cells, "entry")
    assert run(source)["entry"](4) > 5
    assert "mjgrader" not in source


def test_names_of_tuples_loops_and_with_statements_are_found() -> None:
    cells = [
        "low, high = 1, 5",
        "squares = []\nfor i in range(3):\n    last = i * high",
        "def entry():\n    return low + last",
    ]
    assert run(assemble(cells, "entry"))["entry"]() == 11


def test_what_was_never_in_a_cell_is_not_made_up() -> None:
    source = assemble(["def entry():\n    return secret_of_the_kernel"], "entry")
    with pytest.raises(NameError):
        run(source)["entry"]()


@pytest.mark.parametrize("cells", [[], ["x = 1"], ["entry.size = 3"]])
def test_a_function_that_no_cell_defines_is_refused_with_a_sentence(cells: list[str]) -> None:
    with pytest.raises(Sentence, match="No cell defines entry"):
        assemble(cells, "entry")


CELLS = """\
from functools import lru_cache
LIMIT = 2
@lru_cache
def entry(x, start=0.0):
    '''What it does.'''
    def inner(y: int) -> float:
        return [y * LIMIT for _ in range(3)][0] + 0
    return inner(x)
"""


def define(text: str, file: str = "<cell>") -> Any:
    names: dict[str, Any] = {"__name__": "__main__"}
    exec(compile(text, file, "exec", dont_inherit=True), names)
    return names["entry"]


def test_a_function_is_known_where_its_import_is_in_another_cell() -> None:
    cells = ["import math", "def entry(x):\n    return math.sqrt(x)"]
    refuse_other_code(define(cells[1]), assemble(cells, "entry"))
    refuse_other_code(define("\n".join(cells)), assemble(cells, "entry"))


@pytest.mark.parametrize("text", [CELLS, f"\n\n{CELLS}", f"from __future__ import annotations\n{CELLS}"])
def test_a_function_of_the_cells_is_known_by_its_code_on_other_lines(text: str) -> None:
    refuse_other_code(define(text, "elsewhere.py"), assemble([CELLS], "entry"))


@pytest.mark.parametrize(
    ("was", "now"),
    [
        ("return inner(x)", "return inner(x) + 1"),
        ("range(3)", "range(4)"),
        ("LIMIT for", "LIMITS for"),
        ("+ 0", "+ 0.0"),
    ],
)
def test_a_function_that_is_not_that_of_the_cells_is_refused(was: str, now: str) -> None:
    with pytest.raises(Sentence, match=r"entry in your kernel is not the one in your cells: .* %run, exec"):
        refuse_other_code(define(CELLS.replace(was, now)), assemble([CELLS], "entry"))


@pytest.mark.parametrize("function", [len, None, "entry", json.loads])
def test_what_the_cells_only_import_is_not_compared(function: Any) -> None:
    refuse_other_code(function, "from json import loads\n")


def test_a_lambda_is_told_what_to_do() -> None:
    with pytest.raises(Sentence, match="A lambda has no name: write it with def"):
        name_function(lambda: 1)
