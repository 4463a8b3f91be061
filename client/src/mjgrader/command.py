"""`mjgrade`: the same in a terminal."""

import argparse
import base64
import getpass
import os
import re
import sys
from pathlib import Path

from mjgrader.errors import Sentence
from mjgrader.kits import Kit, find_kit
from mjgrader.session import Session

EXIT_RIGHT, EXIT_WRONG, EXIT_REFUSED = 0, 1, 2


def build_parser() -> argparse.ArgumentParser:
    """Returns the commands."""
    parser = argparse.ArgumentParser(prog="mjgrade", description="Check and hand in the exercises of a MuJoCo course.")
    commands = parser.add_subparsers(dest="command")
    sign_in = commands.add_parser("sign-in", help="sign in with a code that you confirm in the browser")
    sign_in.add_argument("url", help="the address of your course's server")
    sign_in.add_argument("--token", action="store_true", help="type a token of your instructor's instead")
    sign_in.add_argument("--insecure", action="store_true", help="allow http, in a safe network")
    commands.add_parser("sign-out", help="delete the token from this machine")
    start = commands.add_parser("start", help="get the kit of an exercise into a folder")
    start.add_argument("question", help="the exercise's id, such as servo-threshold")
    start.add_argument("--quiz", help="its quiz, where several have it")
    for name, text in (
        ("check", "judge the visible cases here, where not the server alone can; no attempt is used"),
        ("submit", "hand in, and wait for the verdict"),
        ("result", "show the newest verdict"),
    ):
        one = commands.add_parser(name, help=text, aliases=["status"] if name == "result" else [])
        one.set_defaults(command=name)
        one.add_argument("file", help="the script", type=Path, nargs="?" if name == "result" else None)
        one.add_argument("--question", help="the exercise, where its kit is not beside the script")
        if name == "submit":
            one.add_argument("--anyway", action="store_true", help="also where it does not run here")
    commands.add_parser("progress", help="show points and due dates")
    commands.add_parser("sync", help="send what was kept without a connection")
    return parser


def main() -> None:
    """Runs one command. Exits with 0 for right, 1 for anything else, 2 where it could not be done. A check is right
    where no case is wrong, as where only the server judges, and the script can be imported or the file be read."""
    parser = build_parser()
    asked = parser.parse_args()
    if asked.command is None:
        parser.print_help()
        return
    try:
        sys.exit(run(asked, Session(say=lambda text: print(write_commands(text), file=sys.stderr))))
    except Sentence as error:
        print(write_commands(str(error)), file=sys.stderr)
        sys.exit(EXIT_REFUSED)
    except KeyboardInterrupt:
        sys.exit(130)


def write_commands(text: str) -> str:
    """Returns a sentence with commands in place of calls: `mjgrade sync` for `g.sync()`, `--quiz x` for `quiz="x"`."""
    text = text.replace("token=getpass.getpass()", "token=True")
    text = re.sub(r"\bg\.(\w+)\(([^()]*)\)", write_call, text)
    return re.sub(r'\b(question|quiz)="([^"]*)"', r"--\1 \2", re.sub(r"\b(insecure|anyway)=True", r"--\1", text))


def write_call(call: re.Match[str]) -> str:
    """Returns the command for a call."""
    arguments = [re.sub(r"^(\w+)=True$", r"--\1", one).strip('"') for one in call[2].split(", ")]
    return " ".join(["mjgrade", call[1].replace("_", "-"), *filter(None, arguments)])


def run(asked: argparse.Namespace, session: Session) -> int:
    """Runs one command; returns its exit status. Raises Sentence."""
    if asked.command == "sign-in":
        token = os.environ.get("MJGRADER_TOKEN") or ask_for_token() if asked.token else None
        session.sign_in(asked.url, token, insecure=asked.insecure)
    elif asked.command == "sign-out":
        session.sign_out()
    elif asked.command == "start":
        kit = session.start(asked.question, asked.quiz)
        print(kit.starter if kit.starter.exists() else kit.folder)
    elif asked.command == "progress":
        print(session.progress())
    elif asked.command == "sync":
        session.sync()
    else:
        return judge(asked, session)
    return EXIT_RIGHT


def ask_for_token() -> str:
    """Returns the token that is typed. Raises Sentence where nothing can be typed."""
    try:
        return getpass.getpass("Token: ")
    except (EOFError, AttributeError):  # AttributeError: there is no stdin at all
        raise Sentence("No token was typed: run this in a terminal, or put the token into MJGRADER_TOKEN.") from None


def judge(asked: argparse.Namespace, session: Session) -> int:
    """Checks or hands in a script, or shows the newest verdict. Raises Sentence."""
    if asked.command == "result" and asked.file is None:
        answer = session.result(asked.question)
        print(answer)
        return EXIT_RIGHT if answer.status == "correct" else EXIT_WRONG
    kit = find_kit_of(asked.file, asked.question)
    if asked.command == "result":
        answer = session.result(kit.name)
    else:
        source = read_script(asked.file, kit.takes)
        if asked.command == "check":
            check = session.check(source, kit, str(asked.file))
            print(check)
            return EXIT_RIGHT if check.passed else EXIT_WRONG
        answer = session.submit(source, kit, str(asked.file), anyway=asked.anyway)
    print(answer)
    return EXIT_RIGHT if answer.status == "correct" else EXIT_WRONG


def find_kit_of(file: Path, question: str | None) -> Kit:
    """Returns the kit of a script: beside it, or below the working folder. Raises Sentence."""
    beside = file.resolve().parent
    if (beside / "exercise.json").is_file():
        return find_kit(beside, question)
    return find_kit(Path.cwd(), question or file.stem.replace("_", "-"))


def read_script(file: Path, takes: str = "python") -> str:
    """Returns the text of a script or a model, or the base64 of a file. Raises Sentence, also for a notebook."""
    if takes == "python" and file.suffix == ".ipynb":
        raise Sentence(
            f"{file} is a notebook: open it in Jupyter and give your function to g.check or g.submit in its last cell, "
            f"or export it as {file.with_suffix('.py').name} and name that here."
        )
    try:
        if takes == "npz":
            return base64.b64encode(file.read_bytes()).decode()
        return file.read_text(encoding="utf-8-sig")  # Windows Notepad writes a byte order mark
    except FileNotFoundError:
        hint = ": write it first, with the kit's script or numpy.savez." if takes == "npz" else "."
        raise Sentence(f"There is no file {file}{hint}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise Sentence(f"{file} cannot be read: {error}") from None


if __name__ == "__main__":
    main()
