"""Embeds Python source in a driver, compiled."""

import __future__

import base64
import marshal
from functools import cache


@cache
def embed_code(source: str) -> str:
    """Returns an expression for the code object of a source. The jail runs the interpreter of this process, and
    compiling these sources there would cost every run milliseconds. Leaves out annotations and docstrings."""
    lean = __future__.annotations.compiler_flag
    code = marshal.dumps(compile(source, "<driver>", "exec", lean, dont_inherit=True, optimize=2))
    return f"marshal.loads(base64.b64decode({base64.b64encode(code).decode()!r}))"
