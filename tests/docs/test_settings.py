"""Settings: unknown names are refused, and every refusal names the setting that cures it."""

import os
import re
from pathlib import Path

import pytest
from pydantic import ValidationError

from grader.settings import OF_TESTS, PREFIX, Settings
from support.command_line import grader


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("GRADER_WORKER", "GRADER_WORKER is no setting: did you mean GRADER_WORKERS?"),
        ("GRADER_DATABSE_URL", "GRADER_DATABSE_URL is no setting: did you mean GRADER_DATABASE_URL?"),
        ("grader_prot", "grader_prot is no setting: did you mean GRADER_PORT?"),
        ("GRADER_XYZZY_PLUGH", "GRADER_XYZZY_PLUGH is no setting"),
    ],
)
def test_an_unknown_setting_is_refused_with_the_nearest_name(
    monkeypatch: pytest.MonkeyPatch, name: str, told: str
) -> None:
    monkeypatch.setenv(name, "1")
    with pytest.raises(ValidationError) as refused:
        Settings()
    assert refused.value.errors()[0]["msg"] == f"Value error, {told}"


PAGE = Path(__file__).parents[2] / "docs" / "settings.md"

WORDS = {
    "content": "the working directory where it has quizzes/, else the checkout's or wheel's own",
    "workers": "one a processor",
    "cache": "`~/.cache/mujoco-grader`",
    "database_url": "SQLite in the data folder",
    "public_origin": "none: loopback alone",
}
"""Defaults that are no value, or that depend on the machine, as the page writes them."""


def describe_default(name: str) -> str:
    """The default of a setting as the page writes it: as one would type it."""
    if name in WORDS:
        return WORDS[name]
    value = getattr(Settings(), name)
    if value is None or value in ((), {}):
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"


def test_the_page_lists_every_setting_with_what_it_does_and_its_default(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in os.environ if name.startswith(PREFIX) and not name.startswith(OF_TESTS)]:
        monkeypatch.delenv(name)
    text = PAGE.read_text(encoding="utf-8")
    listed = dict(re.findall(r"^\| `(GRADER_\w+)` \| (.*) \|$", text, re.MULTILINE))
    told = {f"GRADER_{name.upper()}": f"{field.description} | {describe_default(name)}" for name, field in
            Settings.model_fields.items()}  # fmt: skip
    if os.environ.get("GRADER_TEST_REWRITE"):
        rows = [f"| `{name}` | {told[name]} |" for name in (*listed, *(one for one in told if one not in listed))]
        head = "| setting | does | default |\n|---|---|---|\n"
        before, _, rest = text.partition("| setting | does |")
        PAGE.write_text(before + head + "\n".join(rows) + rest[rest.index("\n\n") :], encoding="utf-8")
        return
    assert listed == told


def test_the_names_that_tests_use_are_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GRADER_TEST_ANYTHING", "1")
    monkeypatch.setenv("GRADER_PORT", "8123")
    assert Settings().port == 8123


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("GRADER_WROKERS", "1", "GRADER_WROKERS is no setting: did you mean GRADER_WORKERS?"),
        ("GRADER_PORT", "99999", "GRADER_PORT: Input should be less than or equal to 65535"),
        ("GRADER_ALLOWED_HOSTS", "a.example", "GRADER_ALLOWED_HOSTS cannot be read. Further names"),
        ("GRADER_ALLOWED_HOSTS", '["https://a.example"]', "GRADER_ALLOWED_HOSTS: https://a.example is no name"),
        ("GRADER_ALLOWED_HOSTS", '["a.example:8000"]', "GRADER_ALLOWED_HOSTS: a.example:8000 is no name"),
        ("GRADER_TRUSTED_PROXIES", '["10.0.0.0/8", "proxy"]', "GRADER_TRUSTED_PROXIES[1]: value is not a valid IPv4"),
        ("GRADER_LOG_FORMAT", "xml", "GRADER_LOG_FORMAT: Input should be 'json', 'text' or 'auto'"),
        ("GRADER_METRICS_TOKEN", "short", "GRADER_METRICS_TOKEN: it has at least 16 characters: `openssl rand"),
        ("GRADER_CACHE", "", "GRADER_CACHE: it is empty: name a folder"),
        ("GRADER_CONTENT", "", "GRADER_CONTENT: it is empty: name a folder"),
        ("GRADER_DATA", "", "GRADER_DATA: it is empty: name a folder"),
        (
            "GRADER_DATABASE_URL",
            "postgresql://ann:secret@host/x?foo=bar",
            "GRADER_DATABASE_URL: PostgreSQL knows no option foo",
        ),
        ("GRADER_PUBLIC_ORIGIN", "grader.example", "GRADER_PUBLIC_ORIGIN is scheme://host[:port]"),
        ("GRADER_PUBLIC_ORIGIN", "https://u:p@grader.example", "GRADER_PUBLIC_ORIGIN is scheme://host[:port]"),
        ("GRADER_PUBLIC_ORIGIN", "https://grader.example#x", "GRADER_PUBLIC_ORIGIN is scheme://host[:port]"),
        ("GRADER_PUBLIC_ORIGIN", "https://grader.example:99999", "GRADER_PUBLIC_ORIGIN is scheme://host[:port]"),
        ("GRADER_PUBLIC_ORIGIN", "ftp://grader.example", "GRADER_PUBLIC_ORIGIN is scheme://host[:port]"),
        ("GRADER_DATABASE_URL", "garbage", "GRADER_DATABASE_URL: it is postgresql://user:password@host:port/name"),
        ("GRADER_DATABASE_URL", "mysql://user@host/name", "GRADER_DATABASE_URL: it is postgresql://"),
        ("GRADER_DATABASE_URL", "postgresql://ann:se@cret@host/name", "in the password write %40 for @"),
        ("GRADER_DATABASE_URL", "postgresql://ann:se/cret@host/name", "%2F for /"),
        ("GRADER_DATABASE_URL", "postgresql://ann:secret@host:5432", "it names no database: it is postgresql://user"),
        ("GRADER_DATABASE_URL", "postgresql://ann:secret@host/?sslmode=require", "it names no database"),
        ("GRADER_DATABASE_URL", "sqlite:///", "GRADER_DATABASE_URL: it names no file"),
        ("GRADER_HOST", "0.0.0.0", "set GRADER_PUBLIC_ORIGIN=https://... first"),
    ],
)
def test_the_command_line_names_the_setting_that_cures_it(
    name: str, value: str, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(name, value)
    done = grader("token", "list")
    assert done.returncode == 2, done.stderr
    assert told in done.stderr
    assert "cret" not in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_database_may_be_named_behind_several_hosts() -> None:
    for url in (
        "postgresql://ann@/grader?host=a,b&port=1,2",
        "postgresql:///grader",
        "postgresql://ann@h?dbname=grader",
        "postgresql+psycopg://ann@h/grader?sslmode=require&options=-csearch_path%3Dx&target_session_attrs=read-write",
    ):
        assert Settings(database_url=url).database == url
