"""Scripts out of Jupyter notebooks: the code cells in order, or one of them, without what only IPython understands.
Nothing of a notebook is run here."""

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from grader.errors import Unprocessable

PYTHON_CELLS = frozenset({"capture", "prun", "time", "timeit"})
"""Cell magics whose cell is Python; a cell with another one, such as `%%bash`, is left out."""

WRITES_PYTHON = re.compile(r"writefile\s.*\.py[\"']?\s*$")
"""The cell magic of a cell that is written to a file of Python, and is Python as well."""

TOKEN = re.compile(
    r'''"""(?:\\.|[^\\])*?"""|\'\'\'(?:\\.|[^\\])*?\'\'\''''
    r"""|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'"""
    r"""|\#[^\n]*|\\\n|.""",
    re.DOTALL,
)
"""What a line may not be cut in: strings, comments, and lines that go on in the next one; else one character."""

TO_THE_END = r"(?:\\\n|[^\n])*"
"""The rest of a line, and of those in which it goes on."""

MAGIC = re.compile(rf"([ \t]*)(?:[%!?]{TO_THE_END}|[\w.,\[\] \t]+=[ \t]*[%!]{TO_THE_END}|[\w.%]+\?\??[ \t]*)(?=\n|$)")
"""A line that only IPython understands: `%matplotlib inline`, `!pip list`, `?name`, `x = !ls`, `name?`."""


def read_notebook(path: Path) -> list[dict[str, Any]]:
    """Returns the code cells of a notebook. Raises OSError, and Unprocessable for what is no notebook."""
    try:
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        return [cell for cell in cells if cell["cell_type"] == "code" and read_source(cell) is not None]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise Unprocessable(f"{path} is no notebook of format 4: save it again with Jupyter.") from error


def read_source(cell: dict[str, Any]) -> str | None:
    """Returns the text of a cell, which is a text or a list of lines; None for anything else."""
    source = cell.get("source")
    lines = [source] if isinstance(source, str) else source
    return "".join(lines) if isinstance(lines, list) and all(isinstance(line, str) for line in lines) else None


def assemble_script(cells: Iterable[dict[str, Any]]) -> str:
    """Returns the code cells as one script, in their order."""
    return "\n\n".join(drop_magics(read_source(cell) or "").rstrip() for cell in cells) + "\n"


def find_cell(cells: Iterable[dict[str, Any]], grade_id: str) -> dict[str, Any]:
    """Returns the code cell with this id of nbgrader. Raises Unprocessable unless there is just one."""
    matching = [cell for cell in cells if read_grade_id(cell) == grade_id]
    if len(matching) != 1:
        raise Unprocessable(f"{len(matching)} code cells have the grade_id {grade_id!r}: there must be one")
    return matching[0]


def read_grade_id(cell: dict[str, Any]) -> Any:
    """Returns the id that nbgrader gave a cell, if it gave one."""
    marks = cell.get("metadata")
    nbgrader = marks.get("nbgrader") if isinstance(marks, dict) else None
    return nbgrader.get("grade_id") if isinstance(nbgrader, dict) else None


def drop_magics(source: str) -> str:
    """Returns a cell with `pass` in place of each line that only IPython understands, so that lines keep their numbers.
    A line that begins with % inside brackets or a string is Python, and stays."""
    cell_magic = re.match(r"\s*%%((\w+)[^\n]*)", source)
    if cell_magic is not None:
        if cell_magic[2] not in PYTHON_CELLS and not WRITES_PYTHON.match(cell_magic[1]):
            return ""
        source = source[cell_magic.end() :]
    parts, at, depth, is_start = list[str](), 0, 0, True
    while at < len(source):
        magic = MAGIC.match(source, at) if is_start else None
        if magic is not None:
            parts.append(f"{magic[1]}pass" + "\n" * magic[0].count("\n"))
            at, is_start = magic.end(), False
            continue
        token = TOKEN.match(source, at)
        assert token is not None
        parts.append(token[0])
        depth = max(0, depth + (token[0] in "([{") - (token[0] in ")]}"))
        is_start = token[0] == "\n" and depth == 0
        at = token.end()
    return "".join(parts)
