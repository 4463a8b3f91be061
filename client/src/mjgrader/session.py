"""What a learner does: signs in, gets a kit, checks, hands in, and reads verdicts."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import httpx

from mjgrader import devices, outbox
from mjgrader.accounts import Account, forget_account, load_account, read_site, save_account
from mjgrader.checking import CELLS, Check, check_source, leave_to_server
from mjgrader.connection import Connection
from mjgrader.errors import NotRunning, Offline, Refusal, Sentence, SignInAgain
from mjgrader.kits import Kit, find_kit, unpack_kit
from mjgrader.showing import Answer
from mjgrader.showing import Progress as ProgressTable

POLL_S = (0.3, 0.5, 1.0, 2.0)
"""Pauses between questions for a verdict [s]; the last one repeats."""
VERDICT_S_MAX = 900.0
OUTAGE_S_MAX = 60.0
"""How long the wait for a verdict goes on without a server, as while it is started anew [s]."""

HANDED_IN = "It is handed in, and graded all the same: g.result() shows the verdict."
NOT_HANDED_IN = "Nothing was handed in, and no attempt is used; with anyway=True it is."
SCOPE_HINT = "Your token is kept in {}; g.sign_out() deletes it."


@dataclass
class Session:
    """The state of one learner in one process. `say` tells her what happens."""

    say: Callable[[str], None] = print
    transport: httpx.BaseTransport | None = None
    account: Account | None = None
    kit: Kit | None = None
    last: Answer | None = None
    folder: Path = field(default_factory=Path.cwd)

    def connect(self) -> Connection:
        """Returns a connection as the learner who is signed in. Raises SignInAgain."""
        self.account = self.account or load_account()
        return Connection(self.account, self.say, self.transport)

    def sign_in(
        self, url: str, token: str | None = None, *, remember: bool = True, insecure: bool = False,
        show: Callable[[Mapping[str, Any]], None] | None = None,
    ) -> None:  # fmt: skip
        """Signs in with a code that is confirmed in the browser, or with a token. Raises Sentence."""
        site = read_site(url, insecure=insecure)
        if token is None:
            codes = devices.ask_for_code(site, self.transport)
            (show or self.show_code)(codes)
            try:
                account = devices.wait_for_token(site, codes, self.say, self.transport)
            except KeyboardInterrupt:
                raise Sentence("The sign-in was stopped: no token was kept.") from None
        else:
            account = Account(site, read_token(token))
        connection = Connection(account, self.say, self.transport)
        try:
            quizzes = connection.get("/quizzes")["items"]  # the token is tried
        except SignInAgain:
            raise SignInAgain(f"{site} does not know this token: copy it again, or ask for a new one.") from None
        names = ", ".join(dict.fromkeys(name for _, name in self.list_exercises(connection, quizzes)))
        self.account = account = account if account.user else read_owner(connection)
        kept = (
            f" {SCOPE_HINT.format(save_account(account))}" if remember else " Your token is kept in this process alone."
        )
        whom = f" as {account.user}" if account.user else ""
        count = f"{len(quizzes)} {'quiz' if len(quizzes) == 1 else 'quizzes'}"
        self.say(f"Signed in{whom} at {site}: {count}, exercises: {names or 'none yet'}.{kept}")
        self.say_what_waits(account)

    def say_what_waits(self, account: Account) -> None:
        """Says which answers wait to be sent: those of this account, and whose the others are."""
        waiting = list(outbox.list_waiting(account.site))
        if any(one.is_of(account) for one in waiting):
            self.say("Answers of yours wait to be sent: g.sync() sends them.")
        for one in waiting:
            if not one.is_of(account):
                self.say(one.tell_owner())

    def show_code(self, codes: Mapping[str, Any]) -> None:
        """Says where to confirm which code."""
        self.say(f"Open {codes['verification_uri_complete']} and confirm the code {codes['user_code']}")

    def sign_out(self) -> None:
        """Forgets the token, here and on this machine."""
        self.account = None
        forget_account()
        self.say("Signed out: the token is deleted from this machine.")

    def start(self, question: str, quiz: str | None = None, folder: str | Path | None = None) -> Kit:
        """Gets the kit of an exercise into a folder of its name. A script that is there stays. Raises Sentence."""
        connection = self.connect()
        quiz = quiz or self.find_quiz(connection, question)
        data = connection.request("GET", f"/quizzes/{quiz}/questions/{question}/kit").content
        target = Path(folder) if folder is not None else self.folder / question
        there = {path.name for path in target.glob("*.*")}
        try:
            self.kit = unpack_kit(data, target)
        except OSError as error:
            raise Sentence(
                f"The kit cannot be written to {target} ({error.strerror}): move what is there, or start elsewhere."
            ) from None
        if (name := self.kit.starter.name) in there:
            self.say(f"Your {name} was there, and was kept.")
        if told := self.kit.tell_next():
            self.say(told)
        return self.kit

    def find_quiz(self, connection: Connection, question: str) -> str:
        """Returns the quiz of a question. Raises Sentence where none or several have it."""
        known = list(self.list_exercises(connection, connection.get("/quizzes")["items"]))
        found = [quiz for quiz, name in known if name == question]
        if not found:
            names = ", ".join(name for _, name in known) or "none yet"
            raise Sentence(f"There is no exercise {question!r}. The course has: {names}.")
        if len(found) > 1:
            raise Sentence(f'Several quizzes have {question}: add quiz="{found[0]}" or one of {", ".join(found[1:])}.')
        return found[0]

    def list_exercises(self, connection: Connection, quizzes: Iterable[Mapping[str, Any]]) -> Iterator[tuple[str, str]]:
        """Yields the quiz and the id of every exercise that is open."""
        for quiz in quizzes:
            shown = connection.get(f"/quizzes/{quiz['id']}").get("questions") or []
            yield from ((str(quiz["id"]), str(one["id"])) for one in shown if one.get("kind") == "code")

    def choose_kit(self, question: str | None, entry: str | None, quiz: str | None = None) -> Kit:
        """Returns the kit that is meant: the one that is named, else the one begun last. Raises Sentence."""
        last = self.kit
        if last is not None and (last.name == question if question else entry in (None, last.exercise["entry"])):
            return last
        return find_kit(self.folder, question, entry, quiz)

    def check(self, source: str, kit: Kit, file: str = CELLS) -> Check:
        """Judges the visible cases on this machine; tracebacks name `file`. A model or a file is left to the server.
        Raises Sentence."""
        return check_source(source, kit, file) if kit.takes == "python" else leave_to_server(kit, file)

    def submit(self, source: str, kit: Kit, file: str = CELLS, *, anyway: bool = False, wait: bool = True) -> Answer:
        """Runs a script in a fresh process, hands it in, and waits for its verdict. A model is handed in as it is, and
        so is a file, whose `source` is its base64. Raises Sentence; NotRunning where the script does not run, which
        uses no attempt, unless `anyway`."""
        connection = self.connect()
        if not anyway and kit.takes == "python":
            self.rehearse(source, kit, file)
        key = "file" if kit.takes == "npz" else "source"
        waiting = outbox.keep(connection, str(kit.exercise["quiz"]), kit.name, source, key)
        outbox.deliver_all(connection, but=waiting)
        self.last = Answer(outbox.deliver(connection, waiting), connection.account.site)
        return self.wait(self.last) if wait else self.last

    def rehearse(self, source: str, kit: Kit, file: str) -> None:
        """Runs the script alone. Raises NotRunning where no visible case returns, or any lacks what it names."""
        try:
            check = self.check(source, kit, file)
        except NotRunning as error:
            raise NotRunning(f"{error} {NOT_HANDED_IN}") from None
        if why := check.obstacle:
            kernel = "NameError" in why and file == CELLS
            hint = "It works only in your kernel: define what it names in a cell. " if kernel else ""
            raise NotRunning(f"{why} {hint}{NOT_HANDED_IN}", check.output)

    def wait(self, answer: Answer) -> Answer:
        """Waits until a submission has its verdict, and says how it stands. Raises Sentence. Where the wait is stopped,
        or the server stays away, the submission comes as it was read last."""
        connection, told, began = self.connect(), "", time.monotonic()
        pauses = iter(POLL_S)
        pause = POLL_S[0]
        try:
            while answer.is_under_way and time.monotonic() - began < VERDICT_S_MAX:
                if answer.status != told:
                    told = answer.status
                    self.say({"queued": "Handed in; waiting for a grader.", "running": "Running."}.get(told, told))
                pause = next(pauses, pause)
                time.sleep(pause)
                answer = self.read_again(connection, answer.id)
            answer = Answer(answer.submission, answer.site, self.count_left(connection, answer))
        except KeyboardInterrupt:
            self.say(f"Stopped waiting. {HANDED_IN}")
            return answer
        except Offline as error:  # without this, a learner hands in again, which uses an attempt
            self.say(f"{error} {HANDED_IN}")
            return answer
        self.last = answer
        if answer.is_under_way:
            self.say("The verdict takes long: g.result() asks again.")
        return answer

    def read(self, connection: Connection, submission: str) -> Answer:
        """Returns a submission as it stands."""
        return Answer(connection.get(f"/submissions/{submission}"), connection.account.site)

    def read_again(self, connection: Connection, submission: str) -> Answer:
        """Returns a submission as it stands; waits where no server answers. Raises Offline where it stays away."""
        began, told = time.monotonic(), False
        while True:
            try:
                return self.read(connection, submission)
            except Offline:
                if time.monotonic() - began >= OUTAGE_S_MAX:
                    raise
            if not told:
                told = True
                self.say("The server does not answer: waiting for it.")
            time.sleep(POLL_S[-1])

    def count_left(self, connection: Connection, answer: Answer) -> int | None:
        """Returns how many attempts are left; None without a limit."""
        shown = connection.get(f"/quizzes/{answer.submission['quiz']}").get("questions") or []
        here = [one for one in shown if one["id"] == answer.submission["question"]]
        left = here[0].get("attempts_left") if here else None
        return None if left is None else int(left)

    def result(self, question: str | None = None) -> Answer:
        """Returns the newest submission, or the newest at an exercise, with its verdict. Raises Sentence."""
        connection = self.connect()
        if self.last is not None and question in (None, self.last.submission["question"]):
            return self.wait(self.read(connection, self.last.id))
        options = {"params": {"question": question, "limit": 1} if question else {"limit": 1}}
        items = connection.get("/submissions", **options)["items"]
        if not items:
            if question:
                self.find_quiz(connection, question)  # names those that there are
            raise Sentence("You have handed in nothing yet.")
        return self.wait(self.read(connection, items[0]["id"]))

    def progress(self) -> ProgressTable:
        """Returns the points and dates of every quiz. Raises Sentence."""
        connection = self.connect()
        quizzes = connection.get("/quizzes")["items"]
        return ProgressTable([connection.get(f"/quizzes/{quiz['id']}") for quiz in quizzes])

    def sync(self) -> list[Answer]:
        """Sends the learner's answers that were kept without a connection. Raises Sentence."""
        connection = self.connect()
        sent = [Answer(one, connection.account.site) for _, one in outbox.deliver_all(connection)]
        self.say(f"Sent: {len(sent)}." if sent else "Nothing of yours waits to be sent.")
        self.last = sent[-1] if sent else self.last
        return sent


def read_token(text: str) -> str:
    """Returns the token in what was pasted. Raises Sentence for what no token can be."""
    token = text.strip()
    if not token:
        raise Sentence("The token is empty: paste the one that your instructor gave you.")
    if not (token.isascii() and token.isprintable()) or " " in token:
        raise Sentence("This is no token, which has ASCII letters, digits, _ and - alone: copy it again, and paste it.")
    return token


def read_owner(connection: Connection) -> Account:
    """Returns the account with the name and the course of its token's owner, which an older server does not tell."""
    try:
        me = connection.get("/me")
    except Refusal:
        return connection.account
    return replace(connection.account, user=me.get("user"), course=me.get("course"))
