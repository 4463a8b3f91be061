"""`mjgrade`: what it reads, and that each mistake ends with one sentence and exit status 2."""

import importlib.util
import io
import json
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import pytest

from mjgrader import notebook
from mjgrader.accounts import Account
from mjgrader.command import build_parser, main, read_script
from mjgrader.command import run as run_command
from mjgrader.errors import Sentence
from mjgrader.kits import Kit
from mjgrader.session import Session
from mjgrader.sources import read_source

BOM = b"\xef\xbb\xbf"


def test_a_script_of_windows_notepad_is_read_without_its_byte_order_mark(tmp_path: Path) -> None:
    script = tmp_path / "swing.py"
    script.write_bytes(BOM + b"def swing():\n    return 1\n")
    assert read_script(script) == "def swing():\n    return 1\n"
    assert read_script(script, "mjcf") == "def swing():\n    return 1\n"
    spec = importlib.util.spec_from_file_location("swing", script)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert read_source(module.swing, "swing") == "def swing():\n    return 1\n"


def test_a_notebook_is_no_script(tmp_path: Path) -> None:
    file = tmp_path / "rk4-step.ipynb"
    file.write_text("{}")
    with pytest.raises(Sentence, match=r"is a notebook: open it in Jupyter .* export it as rk4-step\.py and name that"):
        read_script(file)


@pytest.fixture
def end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """Runs a command in an empty folder; returns its exit status."""
    monkeypatch.setenv("MJGRADER_CONFIG", str(tmp_path / "config"))
    monkeypatch.delenv("MJGRADER_TOKEN", raising=False)
    monkeypatch.chdir(tmp_path)

    def end_command(*arguments: str) -> int:
        monkeypatch.setattr(sys, "argv", ["mjgrade", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        assert isinstance(ended.value.code, int)
        return ended.value.code

    return end_command


@pytest.fixture
def run(end: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Runs a command that cannot be done in an empty folder; returns what it says."""

    def refuse(*arguments: str) -> str:
        assert end(*arguments) == 2
        return capsys.readouterr().err.strip()

    return refuse


@pytest.mark.parametrize("error", [EOFError, AttributeError])
def test_a_token_that_cannot_be_typed_is_told(
    error: type[Exception], run: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(prompt: str) -> str:
        raise error

    monkeypatch.setattr("getpass.getpass", stop)
    assert run("sign-in", "https://grader.example.edu", "--token") == (
        "No token was typed: run this in a terminal, or put the token into MJGRADER_TOKEN."
    )


@pytest.mark.parametrize("token", ["grt_0_se\u00e7ret", "grt_0_a b", "grt_0_a\nb"])
def test_what_no_token_can_be_is_told(token: str, run: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MJGRADER_TOKEN", token)
    assert run("sign-in", "https://grader.example.edu", "--token") == (
        "This is no token, which has ASCII letters, digits, _ and - alone: copy it again, and paste it."
    )


@pytest.mark.parametrize(
    "address",
    ["http://127.0.0.1:abc", "http://127.0.0.1:99999", "http://[::1", "https://exa..mple", "https://\u2603.net",
     f"https://{'a' * 64}.edu", "https://m\u00fcnchen..de"],
)  # fmt: skip
def test_an_address_that_cannot_be_is_told(address: str, run: Callable[..., str]) -> None:
    assert run("sign-in", address) == (
        f"{address!r} is no address of a server: write it like https://grader.example.edu."
    )


def describe(question: str, takes: str) -> dict[str, Any]:
    return {
        "format": 1, "mujoco": "3.14.0", "quiz": "q", "question": question, "title": "Stand", "entry": "solve",
        "takes": takes, "points": 4.0, "limits": {"wall_s": 10.0}, "reveal": "size", "kind": "model",
        "without_integrators": False, "trials": [], "hidden_points": 0.0,
    }  # fmt: skip


def write_kit(folder: Path, question: str, takes: str) -> Path:
    """Writes the description of an exercise; returns the path of the file that is handed in."""
    exercise = describe(question, takes)
    folder.mkdir()
    (folder / "exercise.json").write_text(json.dumps(exercise))
    return Path(Kit(folder, exercise).script)


@pytest.mark.parametrize(
    ("takes", "folder", "moved", "command"),
    [
        ("mjcf", "tower", None, "tower/tower.xml"),
        ("npz", "tower", None, "tower/tower.npz"),
        ("mjcf", "my tower", None, '"my tower/tower.xml"'),
        ("npz", "tower", "best.npz", "best.npz --question tower"),
    ],
)
def test_a_check_of_what_the_server_alone_judges_says_how_to_hand_it_in(
    takes: str, folder: str, moved: str | None, command: str, end: Callable[..., int],
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    file = write_kit(Path(folder), "tower", takes)
    file.write_text("<mujoco/>")
    arguments = [str(file)]
    if moved:
        file.rename(moved)
        arguments = [moved, "--question", "tower"]
    assert end("check", *arguments) == 0
    assert capsys.readouterr().out == (
        f"Stand\nNo attempt is used. Only the server judges tower: hand it in with `mjgrade submit {command}`.\n"
    )


def serve_kit(question: str, takes: str, *scripts: str) -> Session:
    """A learner's session at a server that has one kit, with these scripts."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as kit:
        kit.writestr(f"{question}/exercise.json", json.dumps(describe(question, takes)))
        for name in scripts:
            kit.writestr(f"{question}/{name}", "# Begin here.\n")
    server = httpx.MockTransport(lambda request: httpx.Response(200, content=packed.getvalue()))
    account = Account("https://grader.example.edu", "grt_0_secret")
    return Session(lambda text: print(text, file=sys.stderr), server, account)


@pytest.mark.parametrize(
    ("takes", "script", "begin", "todo"),
    [
        ("python", "stand_up.py", "stand_up.py", ""),
        ("mjcf", "stand_up.xml", "stand_up.xml", ""),
        ("npz", "stand_up.py", "stand_up.py", "edit stand_up.py and run it in its folder"),
        ("npz", None, "", "write it with numpy.savez"),
    ],
)
def test_a_start_names_what_is_there_and_what_comes_next(
    takes: str, script: str | None, begin: str, todo: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    session = serve_kit("stand-up", takes, *filter(None, [script]))
    asked = build_parser().parse_args(["start", "stand-up", "--quiz", "q"])
    folder = tmp_path / "stand-up"
    told = f"You hand in stand_up.npz: {todo}, then `mjgrade submit {folder / 'stand_up.npz'}`.\n" if todo else ""
    assert run_command(asked, session) == 0
    assert capsys.readouterr() == (f"{folder / begin}\n", told)
    if begin:
        run_command(asked, session)
        assert capsys.readouterr().err == f"Your {begin} was there, and was kept.\n{told}"


def test_a_notebook_begins_with_the_script_that_writes_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    cells: list[str] = []
    monkeypatch.setattr(notebook, "find_shell", lambda: SimpleNamespace(set_next_input=cells.append))
    monkeypatch.setattr(notebook, "add_course_module", lambda kit: None)
    for folder, scripts in (("with", ["stand_up.py"]), ("without", [])):
        monkeypatch.setattr(notebook, "session", serve_kit("stand-up", "npz", *scripts))
        notebook.start("stand-up", "q", tmp_path / folder)
        assert capsys.readouterr().err.endswith(f"The kit of Stand is in {tmp_path / folder}.\n")
    assert cells == ["# Begin here.\n"]


@pytest.mark.parametrize("command", ["check", "submit"])
def test_a_file_that_is_not_there_is_told(command: str, run: Callable[..., str]) -> None:
    file = write_kit(Path("tower"), "tower", "mjcf")
    assert run(command, str(file)) == f"There is no file {file}."
    file = write_kit(Path("pole"), "pole", "npz")
    hint = "write it first, with the kit's script or numpy.savez."
    assert run(command, str(file)) == f"There is no file {file}: {hint}"


def test_a_file_where_the_kit_belongs_is_told_and_stays(tmp_path: Path) -> None:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as kit:
        kit.writestr("ring/exercise.json", '{"format": 1}')
    server = httpx.MockTransport(lambda request: httpx.Response(200, content=packed.getvalue()))
    account = Account("https://grader.example.edu", "grt_0_secret")
    (tmp_path / "ring").write_text("mine")
    with pytest.raises(Sentence, match=r"cannot be written to .*ring \(.*\): move what is there, or start elsewhere\."):
        Session(lambda text: None, server, account, folder=tmp_path).start("ring", "q")
    assert (tmp_path / "ring").read_text() == "mine"
