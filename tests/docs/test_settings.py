"""Settings: unknown names are refused, and every refusal names the setting that cures it."""

import pytest
from pydantic import ValidationError

from grader.settings import Settings
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


def test_the_names_that_tests_use_are_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GRADER_TEST_ANYTHING", "1")
    monkeypatch.setenv("GRADER_PORT", "8123")
    assert Settings().port == 8123


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("GRADER_WROKERS", "1", "GRADER_WROKERS is no setting: did you mean GRADER_WORKERS?"),
        ("GRADER_PORT", "99999", "GRADER_PORT: Input should be less than or equal to 65535"),
        ("GRADER_ALLOWED_HOSTS", "a.example", "GRADER_ALLOWED_HOSTS: Further names"),
        ("GRADER_LOG_FORMAT", "xml", "GRADER_LOG_FORMAT: Input should be 'json', 'text' or 'auto'"),
        ("GRADER_METRICS_TOKEN", "short", "GRADER_METRICS_TOKEN: Value should have at least 16"),
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
    assert len(done.stderr.splitlines()) == 1
