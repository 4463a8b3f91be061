"""Webhooks: who may make them, what a receiver gets and can verify, and what happens when it does not take it."""

import json
import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import select, update
from standardwebhooks import Webhook, WebhookVerificationError

from grader.commands.main import cli
from grader.courses.people.erasure import erase_learner
from grader.grading.pipeline import Retries
from grader.platforms.sending.delivering import PAUSES_S, Delivering
from grader.platforms.sending.outgoing import Outgoing
from grader.platforms.sending.webhooks import PreparedMessage, Webhooks, make_message_id
from grader.queue import jobs
from grader.queue.worker import Worker
from grader.store import outbox
from grader.store.outbox import WEBHOOK, Delivery, Destination
from grader.store.results import LearnerAt
from grader.store.tables import now
from grader.store.upkeep import pruning
from platforms.receivers import HERE, Answer, Asked, receiving, resolving
from platforms.working import database_of, work
from support.sites import Site

pytestmark = pytest.mark.slow

API = "/api/v1"
SENDERS = {WEBHOOK: Webhooks(Outgoing([HERE]))}
ROOT = Path(__file__).parents[2]


@dataclass
class Receiver:
    """Keeps what it gets, and answers with the next of `answers`, then with 204."""

    answers: list[Answer] = field(default_factory=list)
    got: list[Asked] = field(default_factory=list)
    url: str = ""

    def respond(self, asked: Asked) -> Answer:
        self.got.append(asked)
        return self.answers.pop(0) if self.answers else Answer(204)


@contextmanager
def a_receiver(*statuses: int | Answer) -> Iterator[Receiver]:
    receiver = Receiver([status if isinstance(status, Answer) else Answer(status) for status in statuses])
    with receiving(receiver.respond) as port:
        receiver.url = f"http://{HERE}:{port}/hook?for=grader"
        yield receiver


@pytest.fixture
def teacher(site: Site) -> httpx.Client:
    return site.client("tina", "instructor")


def create(client: httpx.Client, url: str) -> dict[str, Any]:
    made = client.post(f"{API}/webhooks", json={"url": url})
    assert made.status_code == 201, made.text
    webhook: dict[str, Any] = made.json()
    assert made.headers["location"] == f"{API}/webhooks/{webhook['id']}"
    return webhook


def answer(site: Site, user: str = "ann", option: int = 1, question: str = "q1") -> dict[str, Any]:
    body = {"quiz": "small", "question": question, "answer": option}
    handed_in = site.client(user).post(f"{API}/submissions", json=body)
    assert handed_in.status_code == 201, handed_in.text
    made: dict[str, Any] = handed_in.json()
    return made


def listed(client: httpx.Client, **query: str) -> list[dict[str, Any]]:
    items: list[dict[str, Any]] = client.get(f"{API}/deliveries", params=query).json()["items"]
    return items


def verified(secret: str, asked: Asked) -> Any:
    return Webhook(secret).verify(asked.body, dict(asked.headers))


def test_a_receiver_verifies_what_changed_and_asks_for_the_rest(site: Site, teacher: httpx.Client) -> None:
    with a_receiver() as receiver:
        made = create(teacher, receiver.url)
        assert re.fullmatch(r"whsec_[A-Za-z0-9+/]{43}=", made["secret"])
        handed_in = answer(site)
        work(database_of(site), SENDERS)
    (asked,) = receiver.got
    assert (asked.method, asked.path, asked.headers["content-type"]) == ("POST", "/hook?for=grader", "application/json")
    told = verified(made["secret"], asked)
    assert told["type"] == "result.changed"
    assert told["data"] == {
        "course": site.course, "quiz": "small", "question": "q1", "submission_id": handed_in["id"], "revision": 1,
    }  # fmt: skip
    for changed in (asked.body + b" ", asked.body.replace(b"small", b"large")):
        with pytest.raises(WebhookVerificationError):
            Webhook(made["secret"]).verify(changed, dict(asked.headers))
    rows = site.client("lms", "service").get(f"{API}/results").json()["items"]
    assert [(row["submission_id"], row["revision"]) for row in rows] == [(handed_in["id"], 1)]
    (delivery,) = listed(teacher)
    assert (delivery["state"], delivery["attempts"], delivery["error"]) == ("sent", 0, None)


def test_the_newest_result_wins_and_nothing_is_sent_where_nothing_changed(site: Site, teacher: httpx.Client) -> None:
    with a_receiver() as receiver:
        create(teacher, receiver.url)
        for option in (0, 1, 2):  # wrong, right, and a try that counts for nothing
            last = answer(site, option=option)
        assert last["attempt"] == 3
        work(database_of(site), SENDERS)
        assert [one.json()["data"]["revision"] for one in receiver.got] == [2]
        answer(site, "bob")
        work(database_of(site), SENDERS)
    assert len({one.headers["webhook-id"] for one in receiver.got}) == len(receiver.got) == 2


def test_a_failed_delivery_is_tried_again_under_its_id_with_a_new_time(site: Site, teacher: httpx.Client) -> None:
    with a_receiver(500, Answer(drops=True), 302) as receiver:
        made = create(teacher, receiver.url)
        answer(site)
        work(database_of(site), SENDERS, (0.01, 0.01, 1.1), until_s=2.0)
    assert len(receiver.got) == 4
    assert len({one.headers["webhook-id"] for one in receiver.got}) == len({one.body for one in receiver.got}) == 1
    times = [int(one.headers["webhook-timestamp"]) for one in receiver.got]
    assert times == sorted(times)
    assert times[-1] > times[0]
    assert verified(made["secret"], receiver.got[-1])
    assert listed(teacher)[0]["state"] == "sent"


def test_a_message_after_a_restore_has_a_new_id(site: Site, teacher: httpx.Client) -> None:
    """A new row may get the number of one that the backup did not have."""
    create(teacher, f"http://{HERE}:9/")
    for user in ("ann", "bob"):
        answer(site, user)
    with database_of(site).read() as session:
        ann, bob = session.scalars(select(Delivery).where(Delivery.course == site.course).order_by(Delivery.id)).all()
        again = {name: getattr(ann, name) for name in ("id", "version", "destination", "course", "quiz", "question")}
        bob = Delivery(**again, learner=bob.learner, noted_at=bob.noted_at)
        webhook = session.get_one(Destination, ann.destination)
        ids = [SENDERS[WEBHOOK].prepare(session, row, webhook) for row in (ann, ann, bob)]
    before, retried, after = [one.id for one in ids if isinstance(one, PreparedMessage)]
    assert re.fullmatch(r"msg_[0-9a-f]{32}", before)
    assert (retried, after == before) == (before, False)


def test_a_message_to_each_destination_has_its_own_id() -> None:
    ids = {make_message_id(destination, body) for destination in ("a", "b") for body in (b"{}", b"[]")}
    assert len(ids) == 4


def test_a_receiver_that_does_not_answer_in_time_rests(site: Site, teacher: httpx.Client) -> None:
    """With all that waits for it, and with what comes in the meantime; others are sent to."""
    may_answer = threading.Event()

    def dawdle(asked: Asked) -> Answer:
        slow.append(asked)
        may_answer.wait(30)
        return Answer(204)

    slow: list[Asked] = []
    delivering = Delivering({WEBHOOK: Webhooks(Outgoing([HERE], time_max_s=0.3))}, (0.01,) * 9, rest_s=3.0)
    worker = Worker(database_of(site), {jobs.DELIVER: delivering}, 1, Retries(3))

    def deliver_what_is_due() -> None:
        while worker.do_one():
            pass

    with receiving(dawdle) as port, a_receiver() as fast:
        create(teacher, f"http://{HERE}:{port}/")
        create(teacher, fast.url)
        for user in ("ann", "bob", "cid"):
            answer(site, user)
        deliver_what_is_due()
        assert (len(slow), len(fast.got)) == (1, 3)
        assert {item["attempts"] for item in listed(teacher, state="waiting")} == {0, 1}
        answer(site, "dan")
        deliver_what_is_due()
        assert (len(slow), len(fast.got)) == (1, 4)
        may_answer.set()
        time.sleep(3.1)
        deliver_what_is_due()
        assert (len(slow), len(fast.got)) == (5, 4)
    assert listed(teacher, state="waiting") == []


def dead_letters(site: Site) -> float:
    """Those of webhooks, of all courses, as the server's metrics count them."""
    text = site.anonymous().get("/metrics").text
    match = re.search(r'^grader_outbox_deliveries\{kind="webhook",state="dead"\} (\S+)$', text, re.MULTILINE)
    return 0.0 if match is None else float(match[1])


def test_after_the_last_try_it_is_a_dead_letter_which_is_replayed(
    site: Site, teacher: httpx.Client, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    before = dead_letters(site)
    with a_receiver(500, 503, 500) as receiver:
        made = create(teacher, receiver.url)
        answer(site)
        work(database_of(site), SENDERS)
        (dead,) = listed(teacher, state="dead")
        assert (dead["attempts"], dead["error"]) == (2, "The receiver answered 500.")
        assert dead_letters(site) == before + 1
        monkeypatch.setenv("GRADER_DATABASE_URL", site.settings.database)
        cli(["deliveries", "--course", str(site.course)], standalone_mode=False)
        assert capsys.readouterr().out.split("\t")[0::4] == [dead["id"], "small/q1"]
        assert len(receiver.got) == 3
        replayed = teacher.post(f"{API}/deliveries/{dead['id']}:replay")
        assert (replayed.status_code, replayed.json()["state"]) == (200, "waiting")
        assert teacher.post(f"{API}/deliveries/{dead['id']}:replay").status_code == 409
        work(database_of(site), SENDERS)
    assert listed(teacher, state="dead") == []
    assert {one.headers["webhook-id"] for one in receiver.got} == {receiver.got[0].headers["webhook-id"]}
    actions = [item["action"] for item in teacher.get(f"{API}/audit").json()["items"]]
    assert [action for action in actions if "token" not in action] == ["delivery replayed", "webhook created"]
    assert made["secret"] not in teacher.get(f"{API}/audit").text


def test_all_dead_letters_of_a_webhook_are_replayed_at_once(site: Site, teacher: httpx.Client) -> None:
    with a_receiver(*[500] * 9) as receiver:
        made = create(teacher, receiver.url)
        for user in ("ann", "bob", "cem"):
            answer(site, user)
        work(database_of(site), SENDERS)
        assert len(listed(teacher, state="dead", destination=made["id"])) == 3
        pages = [teacher.get(f"{API}/deliveries", params={"limit": 2})]
        pages += [teacher.get(pages[0].links["next"]["url"])]
        assert [len(page.json()["items"]) for page in pages] == [2, 1]
        assert teacher.post(f"{API}/webhooks/{made['id']}:replay").json() == {"replayed": 3}
        work(database_of(site), SENDERS)
    assert {one["state"] for one in listed(teacher)} == {"sent"}


def test_the_schedule_lasts_about_three_days_and_a_receiver_may_ask_for_more_time(
    site: Site, teacher: httpx.Client
) -> None:
    assert 3 * 86_400 < sum(PAUSES_S) < 3.5 * 86_400
    assert list(PAUSES_S) == sorted(PAUSES_S)
    with a_receiver(Answer(429, headers={"Retry-After": "3600"})) as receiver:
        create(teacher, receiver.url)
        answer(site)
        work(database_of(site), SENDERS, until_s=0.1)
    (waiting,) = listed(teacher, state="waiting")
    due = now().fromisoformat(waiting["next_at"]) - now()
    assert timedelta(seconds=3590) < due < timedelta(seconds=3600 * 1.11)


def test_410_disables_a_webhook_until_it_is_enabled(site: Site, teacher: httpx.Client) -> None:
    with a_receiver(410) as receiver:
        made = create(teacher, receiver.url)
        path = f"{API}/webhooks/{made['id']}"
        for user in ("ann", "bob"):
            answer(site, user)
        work(database_of(site), SENDERS)
        assert len(receiver.got) == 1
        shown = teacher.get(path).json()
        assert shown["disabled_at"] is not None
        assert "410" in shown["why_disabled"]
        assert [one["state"] for one in listed(teacher)] == ["dead", "dead"]
        answer(site, "cem")
        assert len(listed(teacher)) == 2
        assert teacher.post(f"{path}:replay").status_code == 409
        assert teacher.post(f"{path}:enable").json()["disabled_at"] is None
        assert teacher.post(f"{path}:replay").json() == {"replayed": 2}
        work(database_of(site), SENDERS)
    assert len(receiver.got) == 3
    feed = site.client("lms", "service").get(f"{API}/results").json()["items"]
    assert {row["user"] for row in feed} == {"ann", "bob", "cem"}  # what was missed


def test_while_a_secret_is_rotated_either_one_verifies(site: Site, teacher: httpx.Client) -> None:
    with a_receiver() as receiver:
        old = create(teacher, receiver.url)
        new = teacher.post(f"{API}/webhooks/{old['id']}:rotate").json()
        assert new["secret"] != old["secret"]
        assert new["old_secret_until"] is not None
        answer(site)
        work(database_of(site), SENDERS)
        assert verified(old["secret"], receiver.got[0]) == verified(new["secret"], receiver.got[0])
        with database_of(site).write() as session:
            ended = update(Destination).where(Destination.id == old["id"])
            session.execute(ended.values(old_until=now() - timedelta(seconds=1)))
        answer(site, "bob")
        work(database_of(site), SENDERS)
        assert verified(new["secret"], receiver.got[1])
        with pytest.raises(WebhookVerificationError):
            verified(old["secret"], receiver.got[1])
    shown = teacher.get(f"{API}/webhooks").text + teacher.get(f"{API}/webhooks/{old['id']}").text
    assert "secret" not in shown.replace("old_secret_until", "")


def test_a_deleted_webhook_gets_nothing_more(site: Site, teacher: httpx.Client) -> None:
    with a_receiver() as receiver:
        made = create(teacher, receiver.url)
        answer(site)
        assert teacher.delete(f"{API}/webhooks/{made['id']}").status_code == 204
        answer(site, "bob")
        work(database_of(site), SENDERS)
    assert receiver.got == []
    assert listed(teacher) == []
    assert teacher.get(f"{API}/webhooks").json()["items"] == []


def test_two_courses_and_two_webhooks_are_told_apart(site: Site, teacher: httpx.Client) -> None:
    with a_receiver() as one, a_receiver() as two, a_receiver() as others:
        for url in (one.url, two.url):
            create(teacher, url)
        elsewhere = create(site.client("otto", "instructor", f"{site.course}-b"), others.url)
        assert teacher.get(f"{API}/webhooks/{elsewhere['id']}").status_code == 404
        assert teacher.post(f"{API}/webhooks/{elsewhere['id']}:rotate").status_code == 404
        answer(site)
        work(database_of(site), SENDERS)
    assert (len(one.got), len(two.got), len(others.got)) == (1, 1, 0)


def test_who_may_make_a_webhook(site: Site, teacher: httpx.Client) -> None:
    body = {"url": "https://hooks.example/"}
    statuses = {
        role: site.client(f"some {role}", role).post(f"{API}/webhooks", json=body).status_code
        for role in ("student", "instructor", "service")
    }
    assert statuses == {"student": 403, "instructor": 201, "service": 201}
    for scopes, status in ((["lms"], 200), (["results"], 403)):
        token = teacher.post(f"{API}/tokens", json={"user": "lms", "role": "service", "scopes": scopes}).json()["token"]
        client = site.anonymous({"Authorization": f"Bearer {token}"})
        for path in ("webhooks", "deliveries"):
            assert client.get(f"{API}/{path}").status_code == status


@pytest.mark.parametrize("url", ["http://hooks.example/", "https://10.0.0.1/", "https://u:p@hooks.example/", "ftp://a"])
def test_a_url_that_leads_inside_is_refused_when_it_is_named(teacher: httpx.Client, url: str) -> None:
    refused = teacher.post(f"{API}/webhooks", json={"url": url})
    assert refused.status_code == 422
    assert refused.json()["detail"].startswith("url: The ")


def test_a_name_that_leads_inside_later_is_a_dead_letter(site: Site, teacher: httpx.Client) -> None:
    create(teacher, "https://hooks.example/")
    answer(site)
    work(database_of(site), {WEBHOOK: Webhooks(Outgoing(resolve=resolving("10.0.0.1")))})
    assert listed(teacher)[0]["error"] == "The host of the URL is not on the public internet."


def test_a_course_has_a_limit_of_webhooks(teacher: httpx.Client) -> None:
    for number in range(20):
        create(teacher, f"https://hooks.example/{number}")
    assert teacher.post(f"{API}/webhooks", json={"url": "https://hooks.example/"}).status_code == 409


def test_without_a_destination_nothing_is_written(site: Site) -> None:
    answer(site)
    with database_of(site).read() as session:
        assert session.scalars(select(Delivery).where(Delivery.course == site.course)).all() == []


def test_a_change_that_is_rolled_back_is_not_delivered(site: Site, teacher: httpx.Client) -> None:
    create(teacher, "https://hooks.example/")
    database = database_of(site)
    answer(site)
    with database.read() as session:
        (before,) = session.scalars(select(Delivery.version).where(Delivery.course == site.course))
        (learner,) = session.scalars(select(Delivery.learner).where(Delivery.course == site.course))
    with pytest.raises(RuntimeError), database.write() as session:
        outbox.note(session, [LearnerAt(str(site.course), learner, "small", "q1")])
        raise RuntimeError
    with database.read() as session:
        assert session.scalars(select(Delivery.version).where(Delivery.course == site.course)).all() == [before]


def test_a_fault_of_ours_delays_a_delivery_and_stops_no_other(site: Site, teacher: httpx.Client) -> None:
    class Faulty(Webhooks):
        def prepare(self, session: Any, row: Delivery, destination: Destination) -> Any:
            if row.learner == broken:
                raise ZeroDivisionError
            return super().prepare(session, row, destination)

    with a_receiver() as receiver:
        create(teacher, receiver.url)
        broken = answer(site, "ann")["learner"]
        answer(site, "bob")
        work(database_of(site), {WEBHOOK: Faulty(Outgoing([HERE]))})
    assert len(receiver.got) == 1
    assert {one["learner"] == broken: one["state"] for one in listed(teacher)} == {True: "dead", False: "sent"}


def test_an_erased_learner_leaves_no_delivery(site: Site, teacher: httpx.Client) -> None:
    create(teacher, "https://hooks.example/")
    learner = answer(site)["learner"]
    answer(site, "bob")
    database = database_of(site)
    with database.write() as session:
        erase_learner(database, session, member_id=learner, course=site.course)
    assert [one["learner"] == learner for one in listed(teacher)] == [False]
    work(database, SENDERS, until_s=0.1)


def test_old_deliveries_that_were_sent_are_pruned(site: Site, teacher: httpx.Client) -> None:
    with a_receiver() as receiver:
        create(teacher, receiver.url)
        for user in ("ann", "bob"):
            answer(site, user)
            work(database_of(site), SENDERS)
    answer(site, "cem")
    database = database_of(site)
    with database.write() as session:
        first = update(Delivery).where(Delivery.id == int(listed(teacher)[0]["id"]))
        session.execute(first.values(sent_at=now() - timedelta(days=40)))
    assert pruning.prune_deliveries(database, now() - timedelta(days=30)) == 1
    assert [one["state"] for one in listed(teacher)] == ["sent", "waiting"]


def test_a_worker_that_dies_every_time_loses_no_delivery(site: Site, teacher: httpx.Client) -> None:
    """The queue gives such a job up; the delivery goes on by its own schedule."""
    with a_receiver() as receiver:
        create(teacher, receiver.url)
        answer(site)
        database = database_of(site)
        delivering = Delivering(SENDERS, (0.01,))
        with database.write() as session:
            claimed = jobs.claim(session, 1, (jobs.DELIVER,))
            assert claimed is not None
            started = delivering.start(session, claimed.subject)
        assert started is not None
        with database.write() as session:
            assert jobs.finish(session, claimed)
            delivering.give_up(started).store(session)
        assert listed(teacher)[0]["state"] == "waiting"
        work(database, SENDERS)
    assert len(receiver.got) == 1


def test_the_recipe_verifies_a_message(site: Site, teacher: httpx.Client) -> None:
    """The receiver in docs/webhooks.md, run as it stands."""
    text = (ROOT / "docs" / "webhooks.md").read_text()
    (recipe,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    there: dict[str, Any] = {}
    exec(recipe, there)
    with a_receiver() as receiver:
        secret = create(teacher, receiver.url)["secret"]
        handed_in = answer(site)
        work(database_of(site), SENDERS)
    asked = receiver.got[0]
    message = there["verified"](secret, asked.headers, asked.body)
    assert message["data"]["submission_id"] == handed_in["id"]
    for headers, body in (
        (asked.headers, asked.body + b" "),
        ({**asked.headers, "webhook-timestamp": str(int(asked.headers["webhook-timestamp"]) - 600)}, asked.body),
        ({**asked.headers, "webhook-id": "msg_0_0"}, asked.body),
    ):
        with pytest.raises(ValueError, match=r"signature|old"):
            there["verified"](secret, headers, body)
    assert json.loads(asked.body) == message
