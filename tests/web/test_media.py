"""Pictures and files of a content folder, as browsers get them."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import select

from grader.commands.grade import open_pipeline
from grader.courses.people.identity import COOKIE
from grader.courses.people.sign_in import create_sign_in_code, redeem_sign_in_code
from grader.library import NOTHING_PASSED, load
from grader.service.authoring import make_app
from grader.settings import Settings
from grader.store.contents import ContentFile
from support.sites import Site, open_site

PNG = b"\x89PNG\r\n\x1a\n" + bytes(20)
SVG = b'<svg xmlns="http://www.w3.org/2000/svg"><script>alert(1)</script></svg>'


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("content")
    for folder in ("quizzes", "lessons", "images", "files"):
        (root / folder).mkdir()
    question = {"kind": "mcq", "q": '<img src="images/arm.png" alt="An arm">', "options": ["a", "b"], "answer": 0,
                "explain": '<img src="images/arm.png" alt="The arm again">'}  # fmt: skip
    (root / "quizzes/1-check.json").write_text(json.dumps({"id": "1-check", "title": "Q", "questions": [question]}))
    (root / "lessons/1.md").write_text("# A\n\n![Drawn](images/drawn.svg) [data](files/run.csv)\n")
    (root / "images/arm.png").write_bytes(PNG)
    (root / "images/drawn.svg").write_bytes(SVG)
    (root / "files/run.csv").write_bytes(b"t\n0\n")
    return root


@pytest.fixture(scope="module")
def site(content: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    settings = Settings(
        data=tmp_path_factory.mktemp("data"), content=content, workers=0, public_origin="http://127.0.0.1"
    )
    with open_site(settings) as site:
        yield site


def sign_in(site: Site, name: str, role: str = "student") -> httpx.Client:
    """A client with a token, and a session as a browser has it."""
    client = site.client(name, role)
    with site.app.state.services.database.write() as session:
        code = create_sign_in_code(session, name, role, site.course)
        client.cookies.set(COOKIE, redeem_sign_in_code(session, code).secret)
    return client


def addresses(content: Path) -> dict[str, str]:
    return {file.name: file.address for file in load(content).media.values()}


def test_pictures_are_shown_and_files_are_downloads_to_whoever_sees_the_course(site: Site, content: Path) -> None:
    student, at = sign_in(site, "ada"), addresses(content)
    page = student.get("/lessons/1").text
    assert all(f'"{address}"' in page for address in at.values())
    assert f'src="{at["arm.png"]}"' in student.get("/api/v1/quizzes/1-check").json()["questions"][0]["q"]
    sent = {name: student.get(address) for name, address in at.items()}
    assert {name: (one.content, one.headers["content-type"].partition(";")[0]) for name, one in sent.items()} == {
        "arm.png": (PNG, "image/png"), "drawn.svg": (SVG, "image/svg+xml"), "run.csv": (b"t\n0\n", "text/csv"),
    }  # fmt: skip
    for one in sent.values():
        assert one.headers["x-content-type-options"] == "nosniff"
        assert one.headers["content-security-policy"].endswith("sandbox")
        assert "default-src 'none'" in one.headers["content-security-policy"]
        assert one.headers["cache-control"] == "private, max-age=31536000, immutable"
    shown = {name: one.headers["content-disposition"] for name, one in sent.items()}
    assert shown["arm.png"] == "inline"
    assert all(shown[name].startswith("attachment") for name in ("drawn.svg", "run.csv"))
    answered = student.post("/api/v1/submissions", json={"quiz": "1-check", "question": "q1", "answer": 0}).json()
    assert at["arm.png"] in json.dumps(answered["verdict"])
    assert site.anonymous().get(at["arm.png"]).status_code == 401
    assert student.get(at["arm.png"].replace("arm.png", "leg.png")).status_code == 404


def test_nothing_else_of_the_content_is_served_though_the_database_has_it(site: Site, content: Path) -> None:
    library = load(content)
    student = sign_in(site, "ada")
    stored = site.app.state.services.content.archive
    with stored._database.read() as session:
        kept = set(session.scalars(select(ContentFile.sha256)))
    served = {file.sha256 for file in library.media.values()}
    others = kept - served
    assert others and served <= kept
    for sha256 in others:
        for name in ("1-check.json", "arm.png"):
            assert student.get(f"/media/{sha256}/{name}").status_code == 404


def test_a_picture_that_was_replaced_is_still_there_and_a_new_one_is_seen_by_instructors_first(
    site: Site, content: Path
) -> None:
    student, teacher, old = sign_in(site, "ada"), sign_in(site, "tea", "instructor"), addresses(content)["arm.png"]
    (content / "images/arm.png").write_bytes(PNG + b"new")
    new = addresses(content)["arm.png"]
    assert new in teacher.get("/instructor/draft/1-check/q1").text
    assert [one.get(new).status_code for one in (teacher, student)] == [200, 404]
    site.app.state.services.content.get("main").reload()
    assert [student.get(address).status_code for address in (new, old)] == [200, 200]


def test_the_authors_desk_shows_the_pictures_of_the_folder(content: Path, tmp_path: Path) -> None:
    shutil.copytree(content, tmp_path / "content")
    with TestClient(make_app(tmp_path / "content", NOTHING_PASSED, open_pipeline), base_url="http://127.0.0.1") as desk:
        address = addresses(tmp_path / "content")["arm.png"]
        assert address in desk.get("/edit/1-check/q1").text
        assert desk.get(address).headers["content-type"] == "image/png"
        assert desk.get(address.replace("arm", "leg")).status_code == 404
