"""Rosters: what is written is read back, every faulty cell is told with its line, and no cell is a formula."""

import csv
import io
import unicodedata
import zipfile
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.courses.people.external import OWN, External
from grader.courses.people.identity import INVISIBLE, Role
from grader.courses.people.rosters import oneroster
from grader.courses.people.rosters.oneroster import read_files, read_zip, write_zip
from grader.courses.people.rosters.roster import Entry, Roster, decode, read_roster, write_roster
from grader.errors import FaultyRows, Unprocessable

RUNS = "=+-@\t\r"
letters = st.characters(categories=["L", "N", "P", "S"]).filter(lambda letter: not INVISIBLE.match(letter))
words = st.just(oneroster.MISSING) | st.text(letters, min_size=1, max_size=8)
names = (st.lists(words, min_size=1, max_size=3).map(" ".join) | words.map("={}".format)).map(
    lambda name: unicodedata.normalize("NFC", name)
)
externals = st.builds(External, st.sampled_from(["school", "canvas", OWN]), words)
roles = st.sampled_from([Role.STUDENT, Role.INSTRUCTOR])
emails = st.sampled_from(["", "ada@school.example", "=1+1@x"])


def entries(external: st.SearchStrategy[External | None]) -> st.SearchStrategy[list[Entry]]:
    """Rosters on which everybody is once."""
    one = st.builds(Entry, st.just(0), names, roles, emails, external)
    return st.lists(one, max_size=5, unique_by=lambda entry: entry.key)


def known(people: Roster | list[Entry]) -> list[tuple[object, ...]]:
    entries = people.entries if isinstance(people, Roster) else people
    return [(entry.name, entry.role, entry.email, entry.external) for entry in entries]


def faults_of(read: Callable[[], object]) -> list[tuple[str, str]]:
    """Place and reason of every fault."""
    with pytest.raises(FaultyRows) as refused:
        read()
    return [(fault.key, fault.why) for fault in refused.value.faults]


# -- our own form ------------------------------------------------------------------------------------------------------


@given(entries(st.none() | externals))
def test_what_was_written_is_read_back(people: list[Entry]) -> None:
    text = "".join(write_roster(people))
    assert known(read_roster(text)) == known(people)
    assert known(read_roster(decode("", ("\ufeff" + text).encode()))) == known(people)
    for row in csv.reader(io.StringIO(text, newline="")):
        assert not [cell for cell in row if cell.startswith(tuple(RUNS))]


def test_columns_may_be_left_out_and_stand_in_any_order() -> None:
    [ada, bob] = read_roster("role,external_id,name\nstudent,s1,Ada\n\n,, Bob \n", "school").entries
    assert (ada.external, ada.email, ada.role) == (External("school", "s1"), None, Role.STUDENT)
    assert (bob.name, bob.external, bob.role, bob.line) == ("Bob", None, None, 4)


@pytest.mark.parametrize(
    "text",
    ["name;role\nAda;instructor\n", "sep=;\r\nname;role\r\nAda;instructor\r\n", "name\trole\nAda\tinstructor\n",
     "sep=,\nname,role\nAda,instructor\n", '"sep=;"\nrole;name\ninstructor;Ada\n'],
)  # fmt: skip
def test_cells_are_separated_as_spreadsheets_do(text: str) -> None:
    [ada] = read_roster(text).entries
    assert (ada.name, ada.role) == ("Ada", Role.INSTRUCTOR)


def test_faults_name_the_file_and_the_line_below_a_separator() -> None:
    with pytest.raises(FaultyRows) as refused:
        read_roster("sep=;\nname\nAda;x\n", file="cols.csv")
    assert str(refused.value) == "cols.csv: line 3: has 2 cells, the heading 1: quote cells with semicolons"
    with pytest.raises(FaultyRows, match=r"cols\.csv: line 1, name: the column is missing"):
        read_roster("email\n", file="cols.csv")


@pytest.mark.parametrize("text", [0, 1], ids=["users", "enrollments"])
def test_one_file_of_oneroster_alone_is_recognised(text: int) -> None:
    with pytest.raises(Unprocessable, match=r"u\.csv is one of OneRoster's files: import the zip file"):
        read_roster((USERS, ENROLLED)[text], file="u.csv")


def test_every_faulty_cell_is_told_with_its_line_and_column() -> None:
    text = (
        "name,email,role,namespace,external_id\n"
        "Ada,ada@x,student,school,s1\n"
        '"two\nlines",nobody,king,,\n'
        ",b@x,student,school,s2\n"
        "Bob,b@x,student,no blanks,s3\n"
        "Eve,e@x,student,school,\n"
        "Ada L.,a@x,student,school,s1\n"
    )
    told = faults_of(lambda: read_roster(text))
    assert [place for place, _ in told] == [
        "line 3, role", "line 3, email", "line 3, name", "line 5, name", "line 6, external_id", "line 7, external_id",
        "line 8, external_id",
    ]  # fmt: skip
    assert "line 2" in dict(told)["line 8, external_id"]


@pytest.mark.parametrize(
    ("text", "place"),
    [("email\na@x\n", "line 1, name"), ("name,name\na,b\n", "line 1, name"), ("name,nmae\na,b\n", "line 1, nmae"),
     ("name\na,b\n", "line 2")],
)  # fmt: skip
def test_a_heading_that_is_wrong_is_told(text: str, place: str) -> None:
    assert place in [where for where, _ in faults_of(lambda: read_roster(text))]


@pytest.mark.parametrize("text", ["", "\n \n", 'name\n"Ada', f"name\n{'x' * 200_000}\n", "name\n" + "a\n" * 20_001])
def test_what_is_no_roster_is_refused(text: str) -> None:
    with pytest.raises(Unprocessable):
        read_roster(text)


def test_a_file_that_is_not_utf8_is_refused_with_the_cure() -> None:
    with pytest.raises(Unprocessable, match="save it as CSV UTF-8"):
        decode("roster.csv", "name\nLöwe\n".encode("latin-1"))


def test_at_most_a_hundred_faults_are_told() -> None:
    assert len(faults_of(lambda: read_roster("name,role\n" + "Ada,king\n" * 1000))) == 100


def test_a_cell_that_looks_guarded_but_is_not_stays_as_it_is() -> None:
    assert [entry.name for entry in read_roster("name\n'Ada\n'=Bob\n").entries] == ["'Ada", "=Bob"]


# -- OneRoster ---------------------------------------------------------------------------------------------------------

USERS = (
    "sourcedId,status,dateLastModified,enabledUser,username,userIds,givenName,familyName,middleName,identifier,email,"
    "preferredGivenName\n"
    "u1,active,2026-09-01T00:00:00Z,true,ada,,Augusta Ada,Lovelace,,,ada@school.example,Ada\n"
    "u2,,,true,bob,,Bob,-,,,,\n"
    "u3,,,true,grace,,Grace,Hopper,,,,\n"
    "u4,,,false,gone,,Old,Account,,,,\n"
    "u5,tobedeleted,,true,left,,Left,School,,,,\n"
    "u6,,,true,other,,Other,Class,,,,\n"
    "u7,,,true,aide,,An,Aide,,,,\n"
)
ENROLLED = (
    "sourcedId,status,dateLastModified,classSourcedId,schoolSourcedId,userSourcedId,role,primary,beginDate,endDate\n"
    "e1,,,c1,s,u1,student,false,,\ne2,,,c1,s,u2,student,false,,\ne3,,,c1,s,u3,teacher,true,,\ne4,,,c1,s,u3,student,,,\n"
    "e5,,,c1,s,u4,student,,,\ne6,,,c1,s,u5,student,,,\ne7,,,c1,s,u7,aide,,,\ne8,tobedeleted,,c1,s,u6,student,,,\n"
)


def test_the_students_and_teachers_of_a_class_are_read() -> None:
    assert known(read_files(USERS, ENROLLED, "school")) == [
        ("Ada Lovelace", Role.STUDENT, "ada@school.example", External("school", "u1")),
        ("Bob", Role.STUDENT, "", External("school", "u2")),
        ("Grace Hopper", Role.INSTRUCTOR, "", External("school", "u3")),
    ]


def test_who_is_left_out_is_counted_with_the_value_that_was_not_understood() -> None:
    assert read_files(USERS, ENROLLED).left_out == {
        "users.csv, enabledUser: 'false' is not true": 1, "users.csv, status: 'tobedeleted' is not active": 1,
        "enrollments.csv, role: 'aide' is not student or teacher": 1,
        "enrollments.csv, status: 'tobedeleted' is not active": 1,
    }  # fmt: skip
    nobody = read_files(USERS.replace(",true,", ",1,"), ENROLLED.replace(",student,", ",Learner,"))
    assert (nobody.entries, nobody.left_out["enrollments.csv, role: 'Learner' is not student or teacher"]) == ([], 4)
    assert nobody.left_out["users.csv, enabledUser: '1' is not true"] == 1
    other = ENROLLED + "e9,,,c2,s,u6,aide,,,\n"
    assert len(read_files(USERS, other, course_class="c1").left_out) == 4


def test_who_is_there_twice_in_users_is_told_with_their_sourced_id() -> None:
    twice = "sourcedId,givenName,familyName\nu1,Ada,L\nu1,Ada,K\n"
    told = faults_of(lambda: read_files(twice, "classSourcedId,userSourcedId,role\nc1,u1,student\n"))
    assert told == [("line 3, sourcedId", "is the person of line 2: give each person one row")]


def test_one_class_is_chosen_of_several() -> None:
    both = ENROLLED + "e9,,,c2,s,u6,student,,,\n"
    with pytest.raises(Unprocessable, match="choose one by its classSourcedId, of c1, c2"):
        read_files(USERS, both)
    assert [entry.name for entry in read_files(USERS, both, course_class="c2").entries] == ["Other Class"]
    with pytest.raises(Unprocessable, match="no class 'c3'"):
        read_files(USERS, both, course_class="c3")


def test_who_is_enrolled_and_no_user_is_told() -> None:
    told = faults_of(lambda: read_files(USERS, ENROLLED + "e9,,,c1,s,u99,student,,,\n"))
    assert told == [("line 10, userSourcedId", "u99 is not in users.csv")]
    missing = faults_of(lambda: read_files("sourcedId,givenName\nu1,Ada\n", ENROLLED))
    assert missing == [("line 1, familyName", "the column is missing")]


@given(entries(externals))
def test_what_was_written_for_oneroster_is_read_back(people: list[Entry]) -> None:
    one_each = list({entry.external.id: entry for entry in people if entry.external}.values())
    read_back = read_zip(write_zip(one_each, "robots"), "school").entries if one_each else []
    expected = [(entry.name, entry.role, entry.email, entry.external and entry.external.id) for entry in one_each]
    assert [
        (entry.name, entry.role, entry.email, entry.external and entry.external.id) for entry in read_back
    ] == expected


def test_the_zip_file_has_the_columns_of_version_1_2() -> None:
    ada = Entry(0, "Ada Lovelace", Role.STUDENT, "ada@school.example", External("school", "u1"))
    with zipfile.ZipFile(io.BytesIO(write_zip([ada], "robots"))) as packed:
        files = {name: list(csv.DictReader(io.StringIO(packed.read(name).decode()))) for name in packed.namelist()}
        assert {one.date_time for one in packed.infolist()} == {(1980, 1, 1, 0, 0, 0)}  # the same file at any time
    assert files.keys() == {"manifest.csv", "users.csv", "enrollments.csv"}
    [user], [enrollment] = files["users.csv"], files["enrollments.csv"]
    assert tuple(user) == oneroster.USER_COLUMNS and tuple(enrollment) == oneroster.ENROLLMENT_COLUMNS
    filled = {"sourcedId": "u1", "enabledUser": "true", "givenName": "Ada", "familyName": "Lovelace"}
    assert filled.items() <= user.items()
    assert (enrollment["userSourcedId"], enrollment["classSourcedId"], enrollment["role"]) == (
        "u1",
        "robots",
        "student",
    )
    manifest = {row["propertyName"]: row["value"] for row in files["manifest.csv"]}
    assert (manifest["oneroster.version"], manifest["file.users"], manifest["file.orgs"]) == ("1.2", "bulk", "absent")


def zipped(**files: bytes) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, data in files.items():
            packed.writestr(f"folder/{name}.csv", data)
    return made.getvalue()


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_zip_file_with_a_damaged_byte_is_read_or_refused(method: int) -> None:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", method) as packed:
        packed.writestr("users.csv", USERS)
        packed.writestr("enrollments.csv", ENROLLED)
    refused = 0
    for place in range(0, len(made.getvalue()), 3):
        damaged = bytearray(made.getvalue())
        damaged[place] ^= 0xFF
        try:
            read_zip(bytes(damaged))
        except (Unprocessable, FaultyRows):
            refused += 1
    assert refused > 20


def test_zip_files_that_are_broken_or_too_large_are_refused() -> None:
    good = zipped(users=USERS.encode(), enrollments=ENROLLED.encode())
    assert len(read_zip(good).entries) == 3
    bomb = zipped(users=b"x" * (oneroster.FILE_BYTES_MAX + 1), enrollments=ENROLLED.encode())
    assert len(bomb) < 100_000
    many = zipped(**{f"f{n}": b"" for n in range(100)})
    for data, told in (
        (b"PK", "cannot be read"), (good[:200] + b"\0" * 20 + good[220:], "cannot be read"),
        (zipped(users=b""), "enrollments.csv 0 times"), (bomb, "larger than"), (many, "more than 64"),
    ):  # fmt: skip
        with pytest.raises(Unprocessable, match=told):
            read_zip(data)


def test_a_namespace_that_cannot_be_is_told() -> None:
    told = faults_of(lambda: read_files(USERS, ENROLLED, "no blanks"))
    assert {place.partition(", ")[2] for place, _ in told} == {"sourcedId"}
