"""The functions and magics for notebooks, and for any other Python."""

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

from mjgrader.assembling import assemble
from mjgrader.checking import Check
from mjgrader.kits import Kit, add_course_module
from mjgrader.session import Session
from mjgrader.showing import Answer, Progress
from mjgrader.sources import Function, find_shell, list_cells, name_function, read_source, refuse_other_code

session = Session()
"""The learner's session in this process."""


def sign_in(url: str, token: str | None = None, *, remember: bool = True, insecure: bool = False) -> None:
    """Sign in at a course's server: with a code that you confirm in the browser, or with a token of your instructor's.
    The token is kept in your configuration folder, readable by you alone; with remember=False in this process alone."""
    session.sign_in(url, token, remember=remember, insecure=insecure, show=show_code)


def sign_out() -> None:
    """Delete the token from this machine."""
    session.sign_out()


def start(question: str, quiz: str | None = None, folder: str | Path | None = None) -> None:
    """Get the kit of an exercise into a folder of its name; in a notebook the starter comes into a new cell."""
    kit = session.start(question, quiz, folder)
    add_course_module(kit)
    entry = kit.exercise["entry"]
    todo = f" Write {entry}, then g.check({entry})." if kit.takes == "python" else ""
    session.say(f"The kit of {kit.exercise['title']} is in {kit.folder}.{todo}")
    shell = find_shell()
    if shell is not None and kit.starter.exists():
        shell.set_next_input(kit.starter.read_text(encoding="utf-8-sig"))


def check(function: Function, question: str | None = None) -> Check:
    """Judge the visible cases on this machine. No attempt is used, and the server decides."""
    kit = session.choose_kit(question, name_function(function))
    return session.check(read_source(function, kit.exercise["entry"]), kit)


def submit(function: Function, question: str | None = None, quiz: str | None = None, *, anyway: bool = False) -> Answer:
    """Hand in a function with what it needs, wait for the verdict, and return it. The script is shown, and run in a
    fresh process first; where it does not run nothing is handed in, unless anyway=True."""
    kit = session.choose_kit(question, name_function(function), quiz)
    return hand_in(read_source(function, kit.exercise["entry"]), kit, anyway=anyway)


def result(question: str | None = None) -> Answer:
    """Return the newest verdict, or the newest at an exercise."""
    return session.result(question)


def progress() -> Progress:
    """Return points and due dates, in your time zone."""
    return session.progress()


def sync() -> list[Answer]:
    """Send the answers that were kept while there was no connection."""
    return session.sync()


def hand_in(source: str, kit: Kit, *, anyway: bool) -> Answer:
    """Shows a script, and hands it in."""
    count = len(source.splitlines())
    lines = f"{count} line{'s' * (count != 1)}"
    show(
        f"Handing in {lines}:\n{source}",
        f"<details><summary>Handing in {lines}</summary><pre>{escape(source)}</pre></details>",
    )
    return session.submit(source, kit, anyway=anyway)


def show(text: str, markup: str) -> None:
    """Shows HTML in a notebook, text elsewhere."""
    if find_shell() is None:
        session.say(text)
        return
    from IPython.display import publish_display_data

    publish_display_data({"text/plain": text, "text/html": markup})


def show_code(codes: Mapping[str, Any]) -> None:
    """Says where to confirm a code, with a link in a notebook."""
    address = str(codes.get("verification_uri_complete") or codes["verification_uri"])
    text = f"Open {codes['verification_uri']} and confirm the code {codes['user_code']}"
    link = f'<a href="{escape(address)}" target="_blank" rel="noopener">{escape(str(codes["verification_uri"]))}</a>'
    show(text, f"<p>Open {link} and confirm the code <b>{escape(str(codes['user_code']))}</b></p>")


def load_ipython_extension(shell: Any) -> None:
    """Registers %%submit and %%check: a cell that defines the function of an exercise, with its name in the line."""

    def run_cell(line: str, cell: str) -> tuple[str, Kit]:
        kit = session.choose_kit(line.strip() or None, None)
        shell.run_cell(cell).raise_error()
        entry = kit.exercise["entry"]
        source = assemble([*list_cells(shell), shell.transform_cell(cell)], entry)
        refuse_other_code(shell.user_ns.get(entry), source)
        return source, kit

    def submit_cell(line: str, cell: str) -> Answer:
        source, kit = run_cell(line, cell)
        return hand_in(source, kit, anyway=False)

    def check_cell(line: str, cell: str) -> Check:
        return session.check(*run_cell(line, cell))

    shell.register_magic_function(submit_cell, "cell", "submit")
    shell.register_magic_function(check_cell, "cell", "check")
