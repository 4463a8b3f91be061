"""Cells of CSV files: no spreadsheet runs one as a formula, and what was written is read back. Pure."""

import csv
import re
from collections.abc import Iterable, Iterator

BOM = "\ufeff"
FORMULA = re.compile(r"'*(?:\s*[=+\-@＝＋－＠]|[\t\r\n])")
"""Texts that a spreadsheet may run as a formula. Source: OWASP, CSV injection."""


SEPARATORS = re.compile("[;\t]")
"""What begins a new cell in Excel where the decimal sign is a comma, and in text that is pasted."""


class _Line:
    """A file whose `write` returns the text, so that csv.writer.writerow returns the line."""

    def write(self, text: str) -> str:
        return text


def write_lines(rows: Iterable[Iterable[str]]) -> Iterator[str]:
    r"""The lines of a CSV file, ended by "\r\n" (RFC 4180); one row is held at a time. Cells with another spreadsheet's
    separator are quoted too, which csv.writer does not do. Such a spreadsheet honours the quotes of a line's first cell
    alone, so put there what a learner chooses."""
    line = csv.writer(_Line()).writerow
    for row in rows:
        cells = list(row)
        text = line(cells)
        yield f"{','.join(map(quote_cell, cells))}\r\n" if SEPARATORS.search(text) else text


def quote_cell(text: str) -> str:
    """The text in quotes where any spreadsheet would end the cell within it."""
    return f'"{text.replace(chr(34), chr(34) * 2)}"' if re.search(r'[,;\t"\r\n]', text) else text


def guard(text: str) -> str:
    """The text as a cell that no spreadsheet runs: an apostrophe before what looks like a formula. Guarding a guarded
    text adds another apostrophe, so removing one always gives the text back."""
    return f"'{text}" if text and FORMULA.match(text) else text


def unguard(cell: str) -> str:
    """The text that `guard` made a cell of; a cell that it never makes stays as it is."""
    return cell[1:] if cell.startswith("'") and guard(cell[1:]) == cell else cell
