"""Cells of CSV files: no spreadsheet runs one as a formula, and what was written is read back. Pure."""

import csv
import re
from collections.abc import Iterable, Iterator

BOM = "\ufeff"
FORMULA = re.compile(r"'*(?:\s*[=+\-@＝＋－＠]|[\t\r\n])")
"""Texts that a spreadsheet may run as a formula. Source: OWASP, CSV injection."""


class _Line:
    """A file whose `write` returns the text, so that csv.writer.writerow returns the line."""

    def write(self, text: str) -> str:
        return text


def lines(rows: Iterable[Iterable[str]]) -> Iterator[str]:
    r"""The lines of a CSV file, ended by "\r\n" (RFC 4180); one row is held at a time."""
    line = csv.writer(_Line()).writerow
    for row in rows:
        yield line(row)


def guarded(text: str) -> str:
    """The text as a cell that no spreadsheet runs: an apostrophe before what looks like a formula.

    Guarding a guarded text adds another apostrophe, so removing one always gives the text back.
    """
    return f"'{text}" if text and FORMULA.match(text) else text


def unguarded(cell: str) -> str:
    """The text that `guarded` made a cell of; a cell that it never makes stays as it is."""
    return cell[1:] if cell.startswith("'") and guarded(cell[1:]) == cell else cell
