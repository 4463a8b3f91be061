"""Erasing a learner takes the comments on their scripts, and empties the copies of them that instructors ran."""

import json
from datetime import UTC, datetime
from pathlib import Path

from sqlalchemy import select

from grader.courses.people import members
from grader.courses.people.identity import Role
from grader.domain.verdict import Status, Verdict
from grader.store import submissions
from grader.store.engine.database import Database
from grader.store.engine.ids import make_id
from grader.store.reviewing import line_comments
from grader.store.reviewing.line_comments import LineComment, TriedCopy
from grader.store.tables import ERASED, Member, Submission
from grader.store.upkeep import erasure
from grader.store.upkeep.holdings import gather_holdings

THEN = datetime(2026, 9, 1, 12, tzinfo=UTC)
VERDICT = Verdict(status=Status.INCORRECT, points=0, max_points=1, diagnosis="Line 1: SECRET", stdout="SECRET")


def hand_in(member: Member, source: str) -> Submission:
    return submissions.make(
        id=make_id(), course=member.course, learner=member.id, user=member.name, quiz="z", question="q",
        answer=json.dumps({"source": source}), seed=7, content_digest="d", attempt=1,
    )  # fmt: skip


def test_comments_are_exported_and_erased_with_the_learner_and_copies_are_emptied(tmp_path: Path) -> None:
    database = Database(f"sqlite:///{tmp_path / 'grader.db'}")
    database.migrate()
    with database.write() as session:
        ann, bob, tina = (members.get_named(session, name, role, "c") for name, role in
                          (("ann", Role.STUDENT), ("bob", Role.STUDENT), ("tina", Role.INSTRUCTOR)))  # fmt: skip
        session.flush()
        hers, his, copy, own = hand_in(ann, "a"), hand_in(bob, "b"), hand_in(tina, "a SECRET"), hand_in(tina, "mine")
        submissions.add(session, [(submission, VERDICT) for submission in (hers, his, copy, own)], THEN)
        for line, row in ((2, hers), (None, hers), (1, hers), (None, his)):
            session.add(LineComment(course="c", submission_id=row.id, line=line, text=f"on {line}", author=tina.id,
                                    name="tina"))  # fmt: skip
        session.add(TriedCopy(submission_id=copy.id, original=hers.id))
        ids = {"ann": ann.id, "hers": hers.id, "his": his.id, "copy": copy.id, "own": own.id, "tina": tina.id}
    with database.read() as session:
        assert [
            submission.line for submission in line_comments.on_submissions(session, [ids["hers"]])[ids["hers"]]
        ] == [None, 1, 2]
        assert line_comments.list_copies(session, ids["hers"], ids["tina"]) == [ids["copy"]]
        assert line_comments.list_copies(session, ids["hers"], ids["ann"]) == []
        held = gather_holdings(session, session.get_one(Member, ids["ann"]))
        assert [comment["text"] for comment in held["submissions"][0]["line_comments"]] == ["on None", "on 1", "on 2"]
    with database.write() as session:
        erasure.erase(session, session.get_one(Member, ids["ann"]))
    with database.read() as session:
        assert [comment.submission_id for comment in session.scalars(select(LineComment))] == [ids["his"]]
        emptied = session.get_one(Submission, ids["copy"])
        assert (emptied.answer, emptied.seed) == (ERASED, None)
        verdicts = submissions.read_verdicts_by_id(session, [ids["copy"], ids["own"]])
        assert "SECRET" not in json.dumps(verdicts[ids["copy"]])
        assert verdicts[ids["own"]]["stdout"] == "SECRET"  # the instructor's own script is no copy
    database.close()
