"""Notebooks become scripts: the cells in order, lines of IPython left out, and nothing else changed."""

import ast
import json
from pathlib import Path
from typing import Any

import pytest

from grader.errors import Unprocessable
from grader.grading.notebooks import assemble_script, drop_magics, find_cell, read_notebook

KEPT = [
    'text = """\n% no magic\n!neither\n"""',
    "x = (7\n     % 4)",
    "y = 7 \\\n% 4",
    "# what?\n# %matplotlib",
    "s = '#' # a comment with (\nt = 1",
    "q = \"it's\" + '\"'\n",
    "r = '\\''\nu = 1",
    "a = b != c if (b := 1) and (c := 2) else 3",
    "",
]
DROPPED = [
    ("%matplotlib inline\nx = 1", "pass\nx = 1"),
    ("!pip install x\n", "pass\n"),
    ("if True:\n    %time f()\n    x = 1", "if True:\n    pass\n    x = 1"),
    ("files = !ls\nx = 1", "pass\nx = 1"),
    ("t = %timeit -o f()", "pass"),
    ("np.linspace?\nx = 1", "pass\nx = 1"),
    ("?np\nx = f(\n  1)\n%who", "pass\nx = f(\n  1)\npass"),
    ("%%time\nx = 1", "\nx = 1"),
    ("\n%%capture out\nx = 1\n%who", "\nx = 1\npass"),
    ("%%bash\nrm -rf /", ""),
    ("%%html\n<b>", ""),
    ("%%writefile servo.py\nx = 1\n%who", "\nx = 1\npass"),
    ("%%writefile -a 'my servo.py'\nx = 1", "\nx = 1"),
    ("%%writefile notes.txt\nx is 1", ""),
]


@pytest.mark.parametrize("source", KEPT)
def test_python_stays_as_it_is(source: str) -> None:
    assert drop_magics(source) == source


@pytest.mark.parametrize(("source", "expected"), DROPPED)
def test_lines_of_ipython_are_left_out(source: str, expected: str) -> None:
    assert drop_magics(source) == expected
    ast.parse(expected)


def test_every_reference_program_survives_as_a_cell() -> None:
    paths = sorted((Path(__file__).parents[2] / "reference_solutions").rglob("*.py"))
    assert len(paths) > 50
    changed = [path.stem for path in paths if drop_magics(path.read_text(encoding="utf-8")) != path.read_text("utf-8")]
    assert changed == ["crashed__notebook_magic"]


def cell(kind: str, source: Any, **metadata: Any) -> dict[str, Any]:
    return {"cell_type": kind, "source": source, "metadata": metadata}


def write(path: Path, document: Any) -> Path:
    path.write_text(json.dumps(document))
    return path


def test_code_cells_come_in_order(tmp_path: Path) -> None:
    cells = [
        cell("markdown", "# Title"),
        cell("code", ["import math\n", "%who\n", "x = 1"]),
        cell("raw", "nothing"),
        cell("code", "def f():\n    return x\n", nbgrader={"grade_id": "here"}),
    ]
    notebook = read_notebook(write(tmp_path / "a.ipynb", {"cells": cells, "nbformat": 4}))
    assert assemble_script(notebook) == "import math\npass\nx = 1\n\ndef f():\n    return x\n"
    assert assemble_script([find_cell(notebook, "here")]) == "def f():\n    return x\n"
    for grade_id, count in (("elsewhere", 0), ("here", 2)):
        with pytest.raises(Unprocessable, match=f"{count} code cells have the grade_id '{grade_id}'"):
            find_cell([*notebook, *notebook], grade_id)


@pytest.mark.parametrize(
    "document", [[], {}, {"cells": 3}, {"cells": [3]}, {"worksheets": []}, {"cells": [{}]}, "text"]
)
def test_what_is_no_notebook_is_refused_by_name(tmp_path: Path, document: Any) -> None:
    path = write(tmp_path / "a.ipynb", document)
    with pytest.raises(Unprocessable, match=r"a\.ipynb is no notebook of format 4"):
        read_notebook(path)


def test_a_cell_that_is_no_text_is_no_code(tmp_path: Path) -> None:
    path = tmp_path / "a.ipynb"
    assert read_notebook(write(path, {"cells": [cell("code", 3), cell("code", [3])]})) == []
    path.write_bytes(b"\xff")
    with pytest.raises(Unprocessable):
        read_notebook(path)
    path.write_text("[" * 100_000)
    with pytest.raises(Unprocessable):
        read_notebook(path)


def test_a_magic_that_goes_on_in_the_next_line_is_left_out_with_it() -> None:
    cell = "!pip install \\\n    numpy \\\n    scipy\nfiles = !ls \\\n  /tmp\nx = 1\n!ls \\"
    assert drop_magics(cell) == "pass\n\n\npass\n\nx = 1\npass"
