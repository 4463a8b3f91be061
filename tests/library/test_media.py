"""Pictures and files of a content folder: what is read, what is refused, and the addresses that texts get."""

import json
from pathlib import Path
from typing import Any

import pytest

from grader.domain.pages.media import FOLDERS, sniff_type
from grader.errors import ContentError
from grader.library import Library, load, load_files
from grader.library.lesson_text import Prose

PNG = b"\x89PNG\r\n\x1a\n" + bytes(20)
SVG = b'<?xml version="1.0"?>\n<!DOCTYPE svg>\n<!-- an arm -->\n<svg xmlns="http://www.w3.org/2000/svg"/>'
BODIES = {
    "image/png": PNG, "image/jpeg": b"\xff\xd8\xff\xe0", "image/gif": b"GIF89a", "image/webp": b"RIFF\n\n\n\nWEBPVP8 ",
    "image/svg+xml": SVG, "application/xml": b"<mujoco/>", "text/plain": b"a,b\n1,2\n",
    "application/zip": b"PK\x03\x04",
}  # fmt: skip
QUESTION = '<p>See <img src="images/arm.png" alt="An arm"> and <a href="files/run.csv">the run</a>.</p>'


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A content folder with a quiz of JSON, one of Markdown and a lesson that show pictures."""
    write(tmp_path, {
        "images/arm.png": PNG, "images/deep/an arm.svg": SVG, "files/run.csv": b"t,q\n0,1\n", "images/arm.xcf": b"?",
        "quizzes/1-json.json": quiz({"kind": "open", "q": QUESTION}, {"kind": "open", "q": "Without."}),
        "quizzes/1-plain.json": quiz({"kind": "open", "q": "images/arm.png"}, id="1-plain"),
        "quizzes/1-md.md": b"---\ntitle: M\n---\n\n## {#a}\n\nSee ![An arm](images/arm.png)\n",
        "lessons/1.md": b"# A\n\n![An arm](../images/deep/an%20arm.svg) and [data](files/run.csv)\n",
    })  # fmt: skip
    return tmp_path


def quiz(*questions: dict[str, Any], **keys: str) -> bytes:
    return json.dumps({"id": "1-json", "title": "Q", "questions": questions} | keys).encode()


def write(root: Path, files: dict[str, bytes]) -> None:
    for name, body in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_bytes(body)


def show(library: Library) -> list[str]:
    """The texts with pictures: of the quizzes, then of the lesson."""
    (prose,) = library.lessons["1"].parts
    assert isinstance(prose, Prose)
    return [library.question("1-json", "q1").q, library.question("1-md", "a").q, prose.blocks[0]]


def test_texts_name_pictures_by_their_digest_which_those_of_the_quiz_depend_on(root: Path) -> None:
    before = load(root)
    arm, deep, run = (
        before.media[path].address for path in ("images/arm.png", "images/deep/an arm.svg", "files/run.csv")
    )
    assert arm.endswith("/arm.png") and deep.endswith("/an%20arm.svg")
    in_json, in_markdown, in_lesson = show(before)
    assert f'src="{arm}"' in in_json and f'href="{run}"' in in_json
    assert f'src="{arm}"' in in_markdown
    assert f'src="{deep}"' in in_lesson and f'href="{run}"' in in_lesson
    assert [str(warning) for warning in before.warnings] == [
        f"images/arm.xcf: ending: {next(warning.why for warning in before.warnings)}"
    ]
    again = load_files(before.sources["1-json"])
    assert (again.digest("1-json"), again.question("1-json", "q1").q) == (before.digest("1-json"), in_json)
    assert set(before.sources["1-plain"]) == {"quizzes/1-plain.json"}
    write(root, {"images/arm.png": PNG + b"!"})
    after = load(root)
    assert [quiz for quiz in after.digests if after.digest(quiz) != before.digest(quiz)] == ["1-json", "1-md"]


def test_a_missing_picture_or_description_is_named_with_file_and_question(root: Path) -> None:
    wrong = {"kind": "open", "q": '<img src="images/leg.png" alt="A leg"> <img src="images/arm.png">'}
    write(root, {"quizzes/1-json.json": quiz(wrong), "lessons/1.md": b"# A\n\n![A leg](images/leg.png)\n"})
    assert [
        (warning.file, warning.key, warning.why.partition(":")[0])
        for warning in load(root).warnings
        if "quizz" in warning.file
    ] == [
        ("quizzes/1-json.json", "q1.q", 'the picture "arm.png" has no description'),
        ("quizzes/1-json.json", "q1.q", 'the picture "images/leg.png" is not there'),
    ]
    assert ("lessons/1.md", "line 3") in [(warning.file, warning.key) for warning in load(root).warnings]


@pytest.mark.parametrize("kind", BODIES)
def test_a_type_is_told_by_the_bytes(kind: str) -> None:
    assert sniff_type(BODIES[kind]) == kind
    assert sniff_type(b"\xfe" + BODIES[kind]) == ""


@pytest.mark.parametrize(
    ("name", "body", "why"),
    [
        ("images/a.png", b"\xff\xd8\xff", "it is image/jpeg: end its name in .jpg"),
        ("images/a.svg", b"<html><script>alert(1)</script></html>", "it is application/xml"),
        ("files/a.npz", b"no zip", "it is text/plain"),
        ("files/a.csv", b"\x00\x01", "save it again"),
        ("images/a.gif", b"GIF89a" + bytes(5 << 20), "is larger than 4096 KB"),
    ],
)
def test_a_file_that_is_not_what_its_name_says_is_a_fault(root: Path, name: str, body: bytes, why: str) -> None:
    write(root, {name: body})
    with pytest.raises(ContentError) as error:
        load(root)
    (fault,) = error.value.faults
    assert fault.file == name
    assert why in fault.why


def test_nothing_outside_of_the_two_folders_is_served(root: Path) -> None:
    write(root, {"reference_solutions/1-json/q1/arm.png": PNG, "programs/arm.csv": b"1", "models/a.xml": b"<mujoco/>"})
    (root / "images/key.png").symlink_to(root / "reference_solutions/1-json/q1/arm.png")
    (root / "images/.hidden.png").write_bytes(PNG)
    assert all(path.startswith(FOLDERS) for path in load(root).media)
    assert "images/.hidden.png" not in load(root).media
    (root / "images/out.png").symlink_to(root.parent / "out.png")
    (root.parent / "out.png").write_bytes(PNG)
    with pytest.raises(ContentError, match="is a link out of the content folder"):
        load(root)
