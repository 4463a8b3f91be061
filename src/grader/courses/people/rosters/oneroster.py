"""A roster as OneRoster's users.csv and enrollments.csv, in a zip file. Source: 1EdTech OneRoster 1.2, CSV binding.
Files of version 1.1 are read too: their users.csv has a column `role`."""

import io
import lzma
import struct
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace

from grader.courses.people.identity import Role
from grader.courses.people.rosters.roster import (
    FAULTS_MAX,
    NAMESPACE,
    Entry,
    Note,
    Roster,
    RosterLine,
    decode,
    read_email,
    read_entries,
    read_external,
    read_lines,
    read_name,
    require_columns,
)
from grader.courses.rules.csv_cells import guard, write_lines
from grader.errors import Fault, FaultyRows, Unprocessable

USERS, ENROLLMENTS, MANIFEST = "users.csv", "enrollments.csv", "manifest.csv"
FILE_BYTES_MAX = 16 << 20
MEMBERS_MAX = 64

USER_COLUMNS = (
    "sourcedId", "status", "dateLastModified", "enabledUser", "username", "userIds", "givenName", "familyName",
    "middleName", "identifier", "email", "sms", "phone", "agentSourcedIds", "grades", "password",
    "userMasterIdentifier", "resourceSourcedIds", "preferredGivenName", "preferredMiddleName", "preferredFamilyName",
    "primaryOrgSourcedId", "pronouns",
)  # fmt: skip
ENROLLMENT_COLUMNS = (
    "sourcedId", "status", "dateLastModified", "classSourcedId", "schoolSourcedId", "userSourcedId", "role", "primary",
    "beginDate", "endDate",
)  # fmt: skip
ROLES = {"student": Role.STUDENT, "teacher": Role.INSTRUCTOR}
"""The roles of a class that there are here; proctors, aides and administrators are left out."""

COLUMNS = {"name": "givenName", "external_id": "sourcedId", "role": "sourcedId"}
"""What users.csv calls our columns; a role is in the other file, by the person's id."""

BACK = {role: name for name, role in ROLES.items()}
MISSING = "-"
"""Stands for a name that a person of one name does not have: both names are required."""

DAMAGED = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, OSError, EOFError, RuntimeError, ValueError, struct.error
)  # fmt: skip
"""What `zipfile` raises for a file that is damaged, encrypted, or packed in a way that Python does not know."""


def read_zip(data: bytes, namespace: str = NAMESPACE, course_class: str | None = None) -> Roster:
    """Returns the students and teachers of one class in a OneRoster zip file. Raises Unprocessable, FaultyRows."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            texts = read_text(packed, USERS), read_text(packed, ENROLLMENTS)
    except DAMAGED as error:
        raise Unprocessable(f"The zip file cannot be read: {error}") from error
    return read_files(*texts, namespace, course_class)


def read_text(packed: zipfile.ZipFile, name: str) -> str:
    """Returns the text of a file, in whatever folder of the zip file it lies. Raises Unprocessable."""
    if len(packed.namelist()) > MEMBERS_MAX:
        raise Unprocessable(
            f"The zip file holds more than {MEMBERS_MAX} files: a roster has {USERS} and {ENROLLMENTS}."
        )
    entries = [entry for entry in packed.infolist() if entry.filename.rpartition("/")[2] == name]
    if len(entries) != 1:
        raise Unprocessable(f"The zip file holds {name} {len(entries)} times: once is needed.")
    with packed.open(entries[0]) as file:
        data = file.read(FILE_BYTES_MAX + 1)
    if len(data) > FILE_BYTES_MAX:
        raise Unprocessable(f"{name} is larger than {FILE_BYTES_MAX >> 20} MB.")
    return decode(name, data)


def read_files(users: str, enrollments: str, namespace: str = NAMESPACE, course_class: str | None = None) -> Roster:
    """The students and teachers of one class, by the texts of the two files. `course_class` is the `classSourcedId` of
    the class; it may be left out where there is one alone. Left out, and counted by the
    reason, are people of the class who are not enabled, enrolled in another role, or to be deleted. Raises
    Unprocessable, and FaultyRows with all faults."""
    columns, enrolled = read_lines(ENROLLMENTS, enrollments)
    require_columns(ENROLLMENTS, columns, ("classSourcedId", "userSourcedId", "role"))
    left_out: dict[str, str] = {}
    roles = find_roles(enrolled, course_class, left_out)
    columns, people = read_lines(USERS, users)
    require_columns(USERS, columns, ("sourcedId", "givenName", "familyName"))
    entries = read_entries(
        people, lambda row, note: read_entry(row, namespace, roles, note) if is_taken(row, roles, left_out) else None,
        COLUMNS,
    )  # fmt: skip
    known = {row.get("sourcedId") for row in people}
    missing = [(user, row) for user, (_, row) in roles.items() if user not in known]
    if missing:
        raise FaultyRows(
            [row.fault("userSourcedId", f"{user} is not in {USERS}") for user, row in missing[:FAULTS_MAX]]
        )
    taken = {entry.external.id for entry in entries if entry.external is not None}
    return Roster(USERS, entries, Counter(why for user, why in left_out.items() if user not in taken), COLUMNS)


def find_roles(
    enrolled: Sequence[RosterLine], course_class: str | None, left_out: dict[str, str]
) -> dict[str, tuple[Role, RosterLine]]:
    """Role and row by the id of the person, for one class; who both teaches and learns in it teaches. Whom
    another row leaves out is noted in `left_out`, with the reason. Raises Unprocessable for several classes without a
    choice, and FaultyRows."""
    classes = sorted({row.get("classSourcedId") for row in enrolled if is_active(row)})
    if course_class is None and len(classes) > 1:
        some = ", ".join(classes[:10])
        raise Unprocessable(f"{ENROLLMENTS} has several classes: choose one by its classSourcedId, of {some}.")
    if course_class is not None and course_class not in classes:
        raise Unprocessable(f"{ENROLLMENTS} has no class {course_class!r}.")
    roles: dict[str, tuple[Role, RosterLine]] = {}
    faults: list[Fault] = []
    for row in enrolled:
        user, role = row.get("userSourcedId"), ROLES.get(row.get("role").lower())
        if course_class not in (None, row.get("classSourcedId")):
            continue
        if not is_active(row):
            left_out.setdefault(user, say_value(row, "status", "active"))
        elif role is None:
            left_out[user] = say_value(row, "role", " or ".join(ROLES))
        elif not user:
            faults.append(row.fault("userSourcedId", "is missing"))
        elif role is Role.INSTRUCTOR or user not in roles:
            roles[user] = role, row
    if faults:
        raise FaultyRows(faults[:FAULTS_MAX])
    return roles


def say_value(row: RosterLine, column: str, wanted: str) -> str:
    """Says which value of a cell leaves somebody out."""
    return f"{row.file}, {column}: {row.get(column)[:40]!r} is not {wanted}"


def is_taken(row: RosterLine, roles: dict[str, tuple[Role, RosterLine]], left_out: dict[str, str]) -> bool:
    """Says whether a row of users.csv is read: that of a person of the class who is enabled, or one without an id,
    which is a fault. Others of the class are noted in `left_out`, with the reason."""
    user = row.get("sourcedId")
    if user not in roles:
        return not user
    if not is_active(row):
        left_out[user] = say_value(row, "status", "active")
    elif row.get("enabledUser").lower() not in ("", "true"):
        left_out[user] = say_value(row, "enabledUser", "true")
    else:
        return True
    return False


def is_active(row: RosterLine) -> bool:
    """Says whether a row is not to be deleted; a file in bulk mode says nothing."""
    return row.get("status").lower() in ("", "active")


def read_entry(row: RosterLine, namespace: str, roles: dict[str, tuple[Role, RosterLine]], note: Note) -> Entry | None:
    """Returns the person in a row of users.csv. Faults are noted."""
    user = row.get("sourcedId")
    if not user:
        note("sourcedId", "is missing")
        return None
    parts = [row.get(f"preferred{part}") or row.get(part[0].lower() + part[1:]) for part in ("GivenName", "FamilyName")]
    known = [part for part in parts if part and part != MISSING] or parts[
        1:
    ]  # of somebody whose name is MISSING itself
    name = read_name(" ".join(known), note)
    external = read_external(namespace, user, note)
    email = read_email(row.get("email"), note) if "email" in row.cells else None
    return None if external is None else Entry(row.number, name, roles[user][0], email, external)


def write_zip(entries: Iterable[Entry], course: str) -> bytes:
    """The roster as a OneRoster zip file of one class, which is the course. Each entry has an id, its `sourcedId`."""
    people = [replace(entry, line=number) for number, entry in enumerate(entries, 1)]
    files = {
        MANIFEST: make_manifest(),
        USERS: [USER_COLUMNS, *(make_user_row(person) for person in people)],
        ENROLLMENTS: [ENROLLMENT_COLUMNS, *(make_enrollment_row(person, course) for person in people)],
    }
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, rows in files.items():
            member = zipfile.ZipInfo(name)  # of no day: the same roster gives the same file, and the same ETag
            member.external_attr = 0o644 << 16
            text = "".join(write_lines([guard(cell) for cell in row] for row in rows))
            packed.writestr(member, text, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def make_manifest() -> list[Sequence[str]]:
    """Returns the rows of manifest.csv: which files there are."""
    names = (
        "academicSessions", "categories", "classes", "classResources", "courses", "courseResources", "demographics",
        "enrollments", "lineItemLearningObjectiveIds", "lineItems", "lineItemScoreScales", "orgs",
        "resultLearningObjectiveIds", "results", "resultScoreScales", "roles", "scoreScales", "userProfiles",
        "userResources", "users", "resources",
    )  # fmt: skip
    here = {USERS, ENROLLMENTS}
    files = [(f"file.{name}", "bulk" if f"{name}.csv" in here else "absent") for name in names]
    versions = [("manifest.version", "1.0"), ("oneroster.version", "1.2")]
    return [("propertyName", "value"), *versions, *files, ("source.systemName", "MuJoCo grader")]


def make_user_row(entry: Entry) -> list[str]:
    """Returns a row of users.csv."""
    given, _, family = entry.name.rpartition(" ")
    given = given.strip() or MISSING
    if MISSING in (given, family):
        given, family = MISSING, entry.name
    cells = {
        "sourcedId": get_sourced_id(entry), "enabledUser": "true", "username": entry.name,
        "givenName": given, "familyName": family, "email": entry.email or "",
    }  # fmt: skip
    return [cells.get(column, "") for column in USER_COLUMNS]


def make_enrollment_row(entry: Entry, course: str) -> list[str]:
    """Returns a row of enrollments.csv."""
    cells = {
        "sourcedId": f"{course}-{entry.line}", "classSourcedId": course, "schoolSourcedId": course,
        "userSourcedId": get_sourced_id(entry), "role": BACK[entry.role or Role.STUDENT], "primary": "false",
    }  # fmt: skip
    return [cells.get(column, "") for column in ENROLLMENT_COLUMNS]


def get_sourced_id(entry: Entry) -> str:
    """Returns the id of a person in both files."""
    assert entry.external is not None
    return entry.external.id
