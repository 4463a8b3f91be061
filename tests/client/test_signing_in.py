"""Signing in at the real service: a code, its confirmation on the page, and a token that hands in."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from grader.courses.people import sign_in
from grader.courses.people.identity import Role
from grader.courses.people.members import get_named
from mjgrader.accounts import load_account
from mjgrader.errors import Sentence
from mjgrader.session import Session
from support.sites import Site


@pytest.fixture(autouse=True)
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The configuration folder of a learner who waits for nothing."""
    monkeypatch.setenv("MJGRADER_CONFIG", str(tmp_path))
    monkeypatch.setattr("time.sleep", lambda seconds: None)


def confirm(site: Site, codes: Mapping[str, Any], decision: str) -> None:
    """Opens the address that the client shows, as a learner who is signed in, and presses a button."""
    with site.app.state.services.database.write() as session:
        opened = sign_in.start_session(session, get_named(session, "ada", Role.STUDENT, site.course))
    browser = site.anonymous({"Cookie": f"grader_session={opened.secret}", "Sec-Fetch-Site": "same-origin"})
    shown = browser.get(codes["verification_uri_complete"])
    assert "mjgrader on" in shown.text and codes["user_code"] in shown.text
    assert browser.post("/devices", data={"code": codes["user_code"], "decision": decision}).status_code == 303


def test_a_learner_signs_in_with_a_code_and_hands_in(site: Site) -> None:
    session = Session(lambda text: None)
    session.sign_in(site.origin, show=lambda codes: confirm(site, codes, "allow"))
    assert load_account().course == site.course
    made = session.connect().post("/submissions", {"quiz": "small", "question": "q1", "answer": 1})
    assert (made["user"], made["verdict"]["status"]) == ("ada", "correct")


def test_a_sign_in_that_was_refused_on_the_page_makes_no_token(site: Site) -> None:
    with pytest.raises(Sentence, match="refused on the page"):
        Session(lambda text: None).sign_in(site.origin, show=lambda codes: confirm(site, codes, "refuse"))
