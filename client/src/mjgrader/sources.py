"""Where the text of a function comes from: the cells of a notebook, or the file that defines it."""

import __future__

import ast
import inspect
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType
from typing import Any

from mjgrader.assembling import assemble
from mjgrader.errors import Sentence

FUTURE = sum(getattr(__future__, name).compiler_flag for name in __future__.all_feature_names)
"""The flags of `from __future__ import`, which a notebook keeps for later cells."""

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
        if name == "<lambda>":
            raise Sentence("A lambda has no name: write it with def.")
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
    refuse_other_code(shell.user_ns.get(name) if shell is not None and isinstance(function, str) else function, source)
    return source if name == entry else f"{source}\n{entry} = {name}\n"


def read_file_of(function: Function) -> str:
    """Returns the text of the file that defines a function. Raises Sentence."""
    try:
        if isinstance(function, str):
            raise TypeError
        file = inspect.getsourcefile(inspect.unwrap(function))
        assert file is not None
        return Path(file).read_text(encoding="utf-8-sig")
    except (TypeError, OSError, AssertionError):
        raise Sentence(
            "The text of the function cannot be found: write it to a file, and use `mjgrade check FILE`."
        ) from None


def refuse_other_code(function: Any, source: str) -> None:
    """Raises Sentence where a script defines a function of this name, and all of its definitions are other code, as
    after `%run -i` or `exec`. What the script imports is not compared."""
    code = getattr(inspect.unwrap(function) if callable(function) else function, "__code__", None)
    if code is None:
        return
    body = ast.parse(source).body  # IPython compiles statement by statement, and calls of what is imported differ then
    modules = [ast.Module(statements, []) for statements in (body, *([node] for node in body))]
    compiled = [
        compile(module, "script", "exec", flags=code.co_flags & FUTURE, dont_inherit=True) for module in modules
    ]
    defined = [one for whole in compiled for one in list_codes(whole) if one.co_name == code.co_name]
    if defined and strip_places(code) not in map(strip_places, defined):
        raise Sentence(
            f"{code.co_name} in your kernel is not the one in your cells: it was defined anew by %run, exec or an "
            "import. Paste the newest definition into a cell and run it. Nothing was checked or handed in."
        )


def list_codes(code: CodeType) -> Iterator[CodeType]:
    """Yields the codes of all functions and classes in a code, at any depth."""
    for const in code.co_consts:
        if isinstance(const, CodeType):
            yield const
            yield from list_codes(const)


def strip_places(code: CodeType) -> CodeType:
    """Returns a code without file and lines, so that `==` compares instructions, constants and names."""
    constants = tuple(strip_places(const) if isinstance(const, CodeType) else const for const in code.co_consts)
    return code.replace(co_filename="", co_firstlineno=1, co_linetable=b"", co_consts=constants)
