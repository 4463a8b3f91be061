"""Our tool against a platform that others wrote: `make lti-foreign`.

Open edX launches; an instructor chooses a question there; a learner answers; the score arrives.
Usage: PYTHONPATH=src:tests python tests/platforms/foreign/run.py PYTHON, where PYTHON has lti-consumer-xblock
installed.
"""

import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any

import httpx

from grader.courses.people import platforms as rules
from grader.platforms.administration import read_registration
from grader.service.app import create_app
from grader.settings import Settings
from grader.store import platforms
from support.proxies import free_port, listens
from support.servers import serving

HERE = Path(__file__).parent
OURS = {"Sec-Fetch-Site": "same-origin"}
FIELD = re.compile(r'<input[^>]*name="([^"]+)"[^>]*value="([^"]*)"')
ACTION = re.compile(r'action="([^"]+)"')
PATIENCE_S = 60.0


def told(what: str, holds: object) -> None:
    """Prints one line of proof. Ends the run if it does not hold."""
    print(f"{'ok' if holds else 'FAILED'}  {what}", flush=True)
    if not holds:
        sys.exit(1)


def until(find: Callable[[], Any], what: str) -> Any:
    """Waits for a value that counts as true."""
    deadline = time.monotonic() + PATIENCE_S
    while not (value := find()):
        if time.monotonic() > deadline:
            told(what, False)
        time.sleep(0.1)
    return value


def form_in(page: httpx.Response) -> tuple[str, dict[str, str]]:
    """Where a page's form goes, and its fields."""
    action = ACTION.search(page.text)
    told(f"{page.request.url.path} shows a form", page.status_code == 200 and action)
    assert action is not None
    return unescape(action[1]), {name: unescape(value) for name, value in FIELD.findall(page.text)}


def launched(browser: httpx.Client, edx: str, **who: str) -> httpx.Response:
    """What a browser gets that opens a link on the platform, and follows all redirects and forms."""
    begun = browser.get(f"{edx}/start", params=who)
    login = browser.get(begun.headers["location"])
    told("the tool sends the browser to the platform", login.status_code == 303)
    action, fields = form_in(browser.get(login.headers["location"]))
    return browser.post(action, data=fields, headers={"Origin": edx, "Sec-Fetch-Site": "cross-site"})


def choose(browser: httpx.Client, edx: str, origin: str, item: str) -> None:
    """An instructor chooses what the platform's link leads to."""
    chooser = launched(browser, edx, user="teacher-1", role="instructor", name="Tina", selects="1")
    _, fields = form_in(chooser)
    sent = browser.post(f"{origin}/lti/choose", data={"ticket": fields["ticket"], "item": item}, headers=OURS)
    action, fields = form_in(sent)
    taken = browser.post(action, data=fields)
    told(f"the platform takes the signed choice of {item}", taken.status_code == 200)


def link_course(browser: httpx.Client, edx: str, origin: str) -> None:
    """The first instructor links the platform's course with a new course."""
    page = launched(browser, edx, user="teacher-1", role="instructor", name="Tina")
    _, fields = form_in(page)
    linked = browser.post(f"{origin}/lti/course", data={"ticket": fields["ticket"], "course": "robots"}, headers=OURS)
    told("the platform's course is linked", "Linked" in linked.text)


def walk(app: Any, origin: str, edx: str) -> None:
    """The whole way, from the registration to the score."""
    client = httpx.Client(timeout=30)
    state = client.get(f"{edx}/state").json()
    with app.state.services.database.write() as session:
        given = read_registration({"name": "Open edX", "issuer": edx, **state})
        row = rules.add(session, None, given, "1")
    early = client.get(f"{edx}/start", params={"user": "learner-1", "role": "student", "name": "Ada"})
    told("nobody comes before the platform is approved", client.get(early.headers["location"]).status_code == 401)
    with app.state.services.database.write() as session:
        rules.approve(session, None, row.id)
    teacher = httpx.Client(timeout=30)
    link_course(teacher, edx, origin)
    choose(teacher, edx, origin, "1.3-check/q2")
    items = client.get(f"{edx}/state").json()["items"]
    told("the platform has kept the link", items and items[0]["custom"] == {"quiz": "1.3-check", "question": "q2"})
    learner = httpx.Client(timeout=30)
    entered = launched(learner, edx, user="learner-1", role="student", name="Ada")
    told("the learner lands on the question", entered.headers.get("location") == "/?quiz=1.3-check#1.3-check--q2")
    answer = {"quiz": "1.3-check", "question": "q2", "answer": "5 ms"}
    graded = learner.post(f"{origin}/api/v1/submissions", json=answer, headers=OURS)
    told(
        "the learner's answer is graded", graded.status_code == 201 and graded.json()["verdict"]["status"] == "correct"
    )
    scores = until(lambda: client.get(f"{edx}/state").json()["scores"], "the score arrives")
    told(f"the score arrives: {scores}", scores[0]["given"] == scores[0]["maximum"] == 1.0)
    told(
        "it is the learner's, in the right column",
        (scores[0]["user"], scores[0]["resource"]) == ("learner-1", "1.3-check/q2"),
    )
    with app.state.services.database.read() as session:
        told("one platform is registered", len(platforms.all_platforms(session)) == 1)


def main() -> None:
    python = sys.argv[1]
    with tempfile.TemporaryDirectory() as name:
        folder, ports = Path(name), (free_port(), free_port())
        origin, edx = f"http://127.0.0.1:{ports[0]}", f"http://127.0.0.1:{ports[1]}"
        app = create_app(Settings(data=folder / "data", workers=1, private_hosts=("127.0.0.1",)))
        command = [python, str(HERE / "openedx.py"), str(ports[1]), origin, str(folder)]
        with serving(app, port=ports[0]), subprocess.Popen(command) as platform:
            try:
                until(lambda: listens(ports[1]) or platform.poll() is not None, "the platform starts")
                walk(app, origin, edx)
            finally:
                platform.terminate()


if __name__ == "__main__":
    main()
