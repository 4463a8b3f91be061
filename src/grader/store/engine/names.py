"""Names as they are looked for and sorted: without case and accents."""

import re
import unicodedata
from typing import Any

from sqlalchemy import ColumnElement, SQLColumnExpression, String, literal
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.functions import FunctionElement

MARKS = range(0x300, 0x370)
"""The code points of combining accents."""


class Folded(FunctionElement[str]):
    """A name in small letters without accents."""

    type = String()
    inherit_cache = True


def fold_name(name: str | None) -> str | None:
    """The same in Python, which is SQLite's function of this name: its own `lower` knows ASCII alone."""
    if name is None or name.isascii():
        return name and name.lower()
    return "".join(character for character in unicodedata.normalize("NFD", name) if ord(character) not in MARKS).lower()


@compiles(Folded, "sqlite")
def _folded_in_sqlite(element: Folded, compiler: Any, **kw: Any) -> str:
    return f"folded({compiler.process(element.clauses, **kw)})"


@compiles(Folded, "postgresql")
def _folded_in_postgresql(element: Folded, compiler: Any, **kw: Any) -> str:
    name = compiler.process(element.clauses, **kw)
    plain = f"regexp_replace(normalize({name}, NFD), '[\\u{MARKS.start:04x}-\\u{MARKS.stop - 1:04x}]', '', 'g')"
    # Most names are ASCII, and need no more than `lower`.
    return f"lower(CASE WHEN octet_length({name}) = char_length({name}) THEN {name} ELSE {plain} END)"


def holds(name: SQLColumnExpression[str], part: str) -> ColumnElement[bool]:
    """Whether a name holds this text, in any case and with or without accents."""
    return Folded(name).contains(Folded(literal(re.sub("[/%_]", r"/\g<0>", part))), escape="/")
