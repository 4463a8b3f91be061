"""A roster as our own CSV, and what its rows say; `enrolment` compares it with the members of a course."""

import csv
import io
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain

from grader.courses.people.external import OWN, External, check_external
from grader.courses.people.identity import Role, check_name
from grader.courses.rules.csv_cells import guard, unguard, write_lines
from grader.errors import Fault, FaultyRows, Unprocessable
from grader.store.tables import EMAIL

FILE = "roster.csv"
COLUMNS = ("name", "email", "role", "namespace", "external_id")
NAMESPACE = "roster"
"""The namespace of ids where neither the row nor the caller names one."""

ROWS_MAX = 20_000
FAULTS_MAX = 100
ADDRESS = re.compile(r"[^\s@,;<>\"]+@[^\s@,;<>\"]+")
PEOPLE = (Role.STUDENT, Role.INSTRUCTOR)

SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}
DECLARED = re.compile(r'"?sep=([,;\t|])"?\r?\n', re.IGNORECASE)
"""The line above the heading with which a spreadsheet says what separates its cells."""

ONEROSTER = {"sourcedId", "userSourcedId"}
"""Columns of OneRoster's files, which our own form has not."""


@dataclass(frozen=True)
class Entry:
    """A person on a roster. `email` is None where the file has no such column, and empty where the cell is; `role` is
    None where the file says nothing: a member keeps theirs. Without `external` the person is the member of this name
    that an instructor or operator made."""

    line: int
    name: str
    role: Role | None
    email: str | None = None
    external: External | None = None

    @property
    def key(self) -> str:
        """Who is meant: no two entries of a roster may have the same."""
        return f"name:{self.name}" if self.external is None else self.external.account


@dataclass(frozen=True)
class Roster:
    """The people in a file, and how many of it are left out, by the reason. `columns` are the file's own names of ours
    where they differ."""

    file: str
    entries: Sequence[Entry]
    left_out: Mapping[str, int] = field(default_factory=dict)
    columns: Mapping[str, str] = field(default_factory=dict)

    def fault(self, entry: Entry, column: str, why: str) -> Fault:
        """Says what is wrong with one cell of a person."""
        return Fault(self.file, f"line {entry.line}, {self.columns.get(column, column)}", why)


@dataclass(frozen=True)
class RosterLine:
    """A row of a CSV file by column, with the number of the line that it begins on."""

    file: str
    number: int
    cells: Mapping[str, str]

    def get(self, column: str) -> str:
        """Returns the text of a cell, empty if the column is missing; a guard against formulas is taken off."""
        return unguard(self.cells.get(column, "").strip())

    def fault(self, column: str, why: str) -> Fault:
        """Says what is wrong with one cell."""
        return Fault(self.file, f"line {self.number}, {column}", why)


def decode(file: str, data: bytes) -> str:
    """Returns the text of a file, with or without the mark of UTF-8. Raises Unprocessable."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise Unprocessable(f"{file} is not UTF-8 at byte {error.start}: save it as CSV UTF-8.") from error


def read_lines(file: str, text: str) -> tuple[list[str], list[RosterLine]]:
    """The columns of a CSV file, and its rows; empty ones are left out. Cells are separated by what a line `sep=` above
    the heading says, else by commas, semicolons or tabs, as the heading is. Raises Unprocessable for a file that is no
    CSV or too long, and FaultyRows for rows with too many cells."""
    declared = DECLARED.match(text)
    delimiter = declared[1] if declared else find_separator(text)
    above = 1 if declared else 0
    below = io.StringIO(text[declared.end() :] if declared else text, newline="")
    reader = csv.reader(below, delimiter=delimiter, strict=True)
    rows: list[tuple[int, list[str]]] = []
    begins = above + 1
    try:
        for row in reader:
            if any(cell.strip() for cell in row):
                rows.append((begins, row))
            begins = above + reader.line_num + 1
            if len(rows) > ROWS_MAX + 1:
                raise Unprocessable(f"{file} has more than {ROWS_MAX} rows: import it in parts.")
    except csv.Error as error:
        raise Unprocessable(f"{file}: line {begins}: {error}") from error
    if not rows:
        raise Unprocessable(f"{file} is empty: its first line names the columns.")
    columns = [cell.strip() for cell in rows[0][1]]
    cure = f"quote cells with {SEPARATORS[delimiter]}"
    long = [Fault(file, f"line {number}", f"has {len(row)} cells, the heading {len(columns)}: {cure}")
            for number, row in rows[1:] if len(row) > len(columns)]  # fmt: skip
    if long:
        raise FaultyRows(long[:FAULTS_MAX])
    return columns, [RosterLine(file, number, dict(zip(columns, row, strict=False))) for number, row in rows[1:]]


def find_separator(text: str) -> str:
    """Returns what separates the names in the heading."""
    heading = text.partition("\n")[0]
    return next((separator for separator in (",", ";", "\t") if separator in heading), ",")


def require_columns(
    file: str, columns: Sequence[str], wanted: Iterable[str], known: Iterable[str] | None = None
) -> None:
    """Raises FaultyRows if a column is missing, there twice or, where `known` says which there are, unknown."""
    faults = [Fault(file, f"line 1, {name}", "the column is missing") for name in wanted if name not in columns]
    faults += [Fault(file, f"line 1, {name}", "the column is there twice") for name in find_repeated(columns)]
    if known is not None:
        listed = tuple(known)
        cure = f"there is no such column: they are {', '.join(listed)}"
        faults += [Fault(file, f"line 1, {name}", cure) for name in columns if name not in listed]
    if faults:
        raise FaultyRows(faults[:FAULTS_MAX])


def find_repeated(names: Sequence[str]) -> list[str]:
    """Names that occur more than once."""
    return sorted(name for name, count in Counter(names).items() if name and count > 1)


def read_roster(text: str, namespace: str = NAMESPACE, file: str = FILE) -> Roster:
    """Returns the people on a roster in our own form: `name`, and any of the other COLUMNS. `namespace` is that of ids
    in rows that name none, `file` the name that faults mention. Raises Unprocessable, and FaultyRows with all
    faults."""
    columns, rows = read_lines(file, text)
    if ONEROSTER & {*columns}:
        both = "the zip file, or on the command line the folder, that holds users.csv and enrollments.csv"
        raise Unprocessable(f"{file} is one of OneRoster's files: import {both}.")
    require_columns(file, columns, ["name"], COLUMNS)
    has_email = "email" in columns
    entries = read_entries(rows, lambda row, note: read_entry(row, namespace, note, has_email=has_email))
    return Roster(file, entries)


Note = Callable[[str, str], None]
"""Notes a fault of a column of the row that is read."""


def read_entries(
    rows: Iterable[RosterLine], read: Callable[[RosterLine, Note], Entry | None], named: Mapping[str, str] = {}
) -> list[Entry]:
    """Says what `read` makes of the rows; `named` are the file's own names of our columns. Raises FaultyRows if it
    notes faults, or a person is there twice."""
    faults: list[Fault] = []
    entries: dict[str, Entry] = {}
    for row in rows:
        known = len(faults)

        def note(column: str, why: str, row: RosterLine = row) -> None:
            faults.append(row.fault(named.get(column, column), why))

        entry = read(row, note)
        if entry is None or len(faults) > known:
            continue
        if (earlier := entries.setdefault(entry.key, entry)) is not entry:
            column = "name" if entry.external is None else "external_id"
            note(column, f"is the person of line {earlier.line}: give each person one row")
    if faults:
        raise FaultyRows(faults[:FAULTS_MAX])
    return list(entries.values())


def read_entry(row: RosterLine, namespace: str, note: Note, *, has_email: bool) -> Entry:
    """Returns the person in a row of our own form; faults are noted."""
    role = read_role(row.get("role"), note)
    email = read_email(row.get("email"), note) if has_email else None
    external_id = row.get("external_id")
    external = read_external(row.get("namespace") or namespace, external_id, note) if external_id else None
    if not external_id and row.get("namespace"):
        note("external_id", "is missing: a namespace says whose id it is")
    return Entry(row.number, read_name(row.get("name"), note), role, email, external)


def read_name(name: str, note: Note) -> str:
    """Returns the name, if it can be one."""
    try:
        return check_name("person", name)
    except Unprocessable as error:
        note("name", str(error))
        return name


def read_role(role: str, note: Note) -> Role | None:
    """Returns the role, if a person can have it; None where the cell is empty."""
    if role and role not in PEOPLE:
        note("role", f"is {' or '.join(PEOPLE)}, or empty for the role that a member has; not {role!r}")
        return None
    return Role(role) if role else None


def is_email(text: str) -> bool:
    """Says whether a text can be an address."""
    return len(text) <= EMAIL and text.isprintable() and ADDRESS.fullmatch(text) is not None


def read_email(email: str, note: Note) -> str:
    """Returns the address, if it can be one."""
    if email and not is_email(email):
        note("email", f"is no address: one is name@host, of at most {EMAIL} characters")
    return email


def read_external(namespace: str, external_id: str, note: Note) -> External | None:
    """Returns the person's id in another system, if it can be one; in the namespace `grader`, the id of a member."""
    if namespace == OWN:
        return External(OWN, external_id)
    try:
        return check_external(namespace, external_id)
    except Unprocessable as error:
        note("external_id", str(error))
        return None


def write_roster(entries: Iterable[Entry]) -> Iterator[str]:
    """Returns the lines of a roster in our own form, which `read_roster` reads back."""
    everybody = ((entry, entry.external or External("", "")) for entry in entries)
    rows = ((entry.name, entry.email or "", entry.role or "", as_.namespace, as_.id) for entry, as_ in everybody)
    return write_lines(chain([COLUMNS], ([guard(cell) for cell in row] for row in rows)))
