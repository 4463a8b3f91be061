"""What docs/lti.md says is so: its addresses are served, its commands run."""

import re
import shlex
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from typer.testing import CliRunner

from grader.commands.main import cli
from grader.platforms.tool import canvas_configuration, list_addresses
from platforms.joined import Joined
from platforms.platform import get_json

DOC = (Path(__file__).parents[3] / "docs" / "lti.md").read_text(encoding="utf-8")
ORIGIN = "https://grader.example.org"
URLS = sorted({url.rstrip(".") for url in re.findall(rf"{ORIGIN}[^`\s)]*", DOC)} - {ORIGIN})
SHELL = "".join(re.findall(r"```sh\n(.*?)```", DOC, re.DOTALL)).replace("\\\n", "")
COMMANDS = [line.partition("#")[0] for line in SHELL.splitlines() if line.startswith("grader lti")]


@pytest.mark.parametrize("url", URLS)
def test_every_address_is_served(pair: Joined, url: str) -> None:
    parts = urlsplit(url)
    method = "POST" if parts.path == "/lti/launch" else "GET"
    answered = pair.browser().request(method, f"{parts.path}?{parts.query}")
    assert answered.status_code in (200, 401, 422), answered.text


def test_the_addresses_are_all_there() -> None:
    assert set(list_addresses(ORIGIN).values()) <= set(URLS)


def test_canvas_gets_the_same_addresses(pair: Joined) -> None:
    told = get_json(pair.browser(), "/lti/canvas.json")
    assert told == canvas_configuration(pair.site.origin)
    here = list_addresses(pair.site.origin)
    assert told["oidc_initiation_url"] == here["login_url"]
    assert told["target_link_uri"] == here["launch_url"]
    assert told["public_jwk_url"] == here["keys_url"]
    [extension] = told["extensions"]
    assert {placement["placement"] for placement in extension["settings"]["placements"]} == {
        "assignment_selection",
        "link_selection",
    }


@pytest.mark.parametrize("line", [line for line in COMMANDS if " add " in line])
def test_every_registration_is_taken(line: str, tmp_path: Path) -> None:
    words = shlex.split(line)[1:]
    done = CliRunner().invoke(cli, [*words, "--data", str(tmp_path)], catch_exceptions=False)
    assert (done.exit_code, done.stdout.strip()) == (0, "1")


@pytest.mark.parametrize("name", sorted({shlex.split(line)[2] for line in COMMANDS}))
def test_every_command_exists(name: str) -> None:
    assert CliRunner().invoke(cli, ["lti", name, "--help"]).exit_code == 0
