"""Where the text of a function comes from: the cells of a notebook, or the file that defines it."""

import inspect
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mjgrader.assembling import assemble
from mjgrader.errors import Sentence

MAGICS = ("%%submit", "%%check")
Function = Callable[..., Any] | str


def find_shell() -> Any | None:
    """Returns IPython's shell, where this is one."""
    ipython = sys.modules.get("IPython")
    return None if ipython is None else ipython.get_ipython()


def list_cells(shell: Any) -> list[str]:
    """Returns the cells that were run, in order, as Python. Of the magics of this client the cell below counts."""
    cells = []
    for raw in shell.history_manager.input_hist_raw[1:]:
        text = raw.partition("\n")[2] if raw.lstrip().startswith(MAGICS) else raw
        cells.append(shell.transform_cell(text))
    return cells


def name_function(function: Function) -> str:
    """Returns the name of a function. Raises Sentence for anything else."""
    name = function if isinstance(function, str) else getattr(function, "__name__", "")
    if not isinstance(name, str) or not name.isidentifier():
        raise Sentence("Give the function itself, as in g.check(largest_stable_timestep), or its name.")
    return name


def read_source(function: Function, entry: str) -> str:
    """Returns the script that defines a function, under the name that the exercise asks for. Raises Sentence."""
    name = name_function(function)
    shell = find_shell()
    if shell is not None:
        source = assemble(list_cells(shell), name)
    else:
        source = assemble([read_file_of(function)], name)
    return source if name == entry else f"{source}\n{entry} = {name}\n"


def read_file_of(function: Function) -> str:
    """Returns the text of the file that defines a function. Raises Sentence."""
    try:
        if isinstance(function, str):
            raise TypeError
        file = inspect.getsourcefile(inspect.unwrap(function))
        assert file is not None
        return Path(file).read_text(encoding="utf-8")
    except (TypeError, OSError, AssertionError):
        raise Sentence(
            "The text of the function cannot be found: write it to a file, and use `mjgrade check FILE`."
        ) from None
