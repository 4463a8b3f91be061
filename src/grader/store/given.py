"""A JSON list as the rows of a statement: one parameter, however many items there are."""

from typing import Any

from sqlalchemy import String, bindparam
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.functions import FunctionElement

PARTS = 7
"""The most texts of an item that a statement can name."""


class Given(FunctionElement[Any]):
    """The items of a JSON list of lists of texts, as rows: one parameter, however many they are."""

    name = "given"
    inherit_cache = True


class Part(FunctionElement[str]):
    """The text at a place of such an item."""

    type = String()
    inherit_cache = True


@compiles(Given, "sqlite")
def _given_in_sqlite(element: Given, compiler: Any, **kw: Any) -> str:
    return f"json_each({compiler.process(element.clauses, **kw)})"


@compiles(Given, "postgresql")
def _given_in_postgresql(element: Given, compiler: Any, **kw: Any) -> str:
    # Taken apart once: `->>` reads the whole text again, and would do so for every row that it is compared with.
    parts = ", ".join(f"item ->> {place} AS value{place}" for place in range(PARTS))
    items = f"json_array_elements(CAST({compiler.process(element.clauses, **kw)} AS json)) AS item"
    return f"(SELECT {parts} FROM {items} OFFSET 0)"  # noqa: S608  no values; without OFFSET the parts are put back


@compiles(Part, "sqlite")
def _part_in_sqlite(element: Part, compiler: Any, **kw: Any) -> str:
    item, place = element.clauses
    return f"json_extract({compiler.process(item, **kw)}, '$[{place.value}]')"


@compiles(Part, "postgresql")
def _part_in_postgresql(element: Part, compiler: Any, **kw: Any) -> str:
    item, place = element.clauses
    return f"{compiler.process(item, **kw)}{place.value}"


GIVEN = Given(bindparam("given", type_=String)).table_valued("value", name="given")
