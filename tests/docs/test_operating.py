"""deploy/alerts.yml, deploy/compose.yaml and docs/operating.md: what they name exists; an alert has its paragraph."""

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import promql_parser
import pytest
import yaml

from grader.domain.verdict import Status
from grader.queue.jobs import TOPICS
from grader.settings import Settings
from grader.store.outbox import KINDS, STATES
from support.sites import open_site, write_content

pytestmark = [pytest.mark.slow, pytest.mark.jail]

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "deploy"
RULES = yaml.safe_load((DEPLOY / "alerts.yml").read_text())["groups"][0]["rules"]
NAMES = [rule["alert"] for rule in RULES]
PAGE = (ROOT / "docs/operating.md").read_text(encoding="utf-8")
OF_PROMETHEUS = {"up": {"job", "instance"}}


def selectors(expression: str) -> list[promql_parser.VectorSelector]:
    """Every choice of a metric in an expression, which must be PromQL."""
    selectors: list[promql_parser.VectorSelector] = []

    def visit(node: Any) -> bool:
        if isinstance(node, promql_parser.VectorSelector):
            selectors.append(node)
        return True

    promql_parser.walk(promql_parser.parse(expression), visit)
    return selectors


VALUES = {
    "topic": set(TOPICS), "state": set(STATES), "kind": set(KINDS), "status": {*Status, "5.."},
    "route": {".*/events"}, "job": {"grader"}, "tier": {"T0", "T1", "T2"},
}  # fmt: skip


@pytest.mark.parametrize("rule", RULES, ids=NAMES)
def test_an_alert_is_promql_on_metrics_and_labels_of_ours(rule: dict[str, Any], exposed: str) -> None:
    types = dict(re.findall(r"^# TYPE (\S+) (\S+)$", exposed, re.MULTILINE))
    shown = {name if kind != "histogram" else f"{name}_bucket" for name, kind in types.items()}
    chosen = selectors(rule["expr"])
    assert chosen
    for selector in chosen:
        assert selector.name in shown | OF_PROMETHEUS.keys()
        for matcher in selector.matchers.matchers:
            assert matcher.value in VALUES[matcher.name]


@pytest.fixture(scope="module")
def exposed(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The text of /metrics of a server that grades."""
    folder = tmp_path_factory.mktemp("operating")
    settings = Settings(data=folder / "data", content=write_content(folder / "content"), workers=1)
    with open_site(settings) as site:
        return site.anonymous().get("/metrics").raise_for_status().text


def test_counters_that_alerts_watch_begin_at_zero(exposed: str) -> None:
    """Prometheus sees no increase in a series that begins with 1: the first fault would raise no alert."""
    for status in Status:
        assert f'grader_verdicts_total{{status="{status}"}} ' in exposed
    for topic in TOPICS:
        assert f'grader_job_failures_total{{topic="{topic}"}} ' in exposed


def test_a_wrong_expression_is_no_promql() -> None:
    with pytest.raises(ValueError, match="invalid promql"):
        selectors("max by (grader_workers) <")


def test_every_alert_has_its_paragraph_and_says_how_urgent_it_is() -> None:
    assert re.findall(r"^### (\w+)$", PAGE, re.MULTILINE) == NAMES
    assert all(rule["labels"]["severity"] in ("page", "ticket") for rule in RULES)
    assert all(rule["annotations"]["summary"] for rule in RULES)


def test_the_settings_and_metrics_that_the_page_names_exist(exposed: str) -> None:
    assert {name.lower() for name in re.findall(r"GRADER_([A-Z_0-9]+)", PAGE)} <= set(Settings.model_fields)
    known = set(re.findall(r"^# TYPE (\S+)", exposed, re.MULTILINE))
    named = {name.removesuffix("_bucket") for name in re.findall(r"grader_\w+", PAGE)} - {"grader_token"}
    assert named <= known
    for block in re.findall(r"`((?:sum|histogram_quantile)[^`]*)`", PAGE):
        assert selectors(block)


# -- compose -----------------------------------------------------------------------------------------------------------

COMPOSE = yaml.safe_load((DEPLOY / "compose.yaml").read_text())


def compose_program() -> list[str]:
    """`docker compose` where the plug-in is there, else the program of the Debian package; neither needs an engine."""
    plugin = ["docker", "compose"]
    if shutil.which("docker") and not subprocess.run([*plugin, "version"], capture_output=True, check=False).returncode:
        return plugin
    program = shutil.which("docker-compose")
    assert program, "docker-compose is missing: `make test` installs it"
    return [program]


@pytest.mark.process
def test_compose_accepts_its_file(tmp_path: Path) -> None:
    command = [*compose_program(), "-f", str(DEPLOY / "compose.yaml"), "config"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert set(yaml.safe_load(done.stdout)["services"]) == {"server", "worker", "database", "proxy"}
    wrong = tmp_path / "compose.yaml"
    wrong.write_text(
        (DEPLOY / "compose.yaml").read_text().replace("    init: true", "    intit: true", 1).replace("init:", "intit:")
    )
    refused = subprocess.run(
        [*compose_program(), "-f", str(wrong), "config"], capture_output=True, text=True, check=False
    )
    assert refused.returncode != 0


def test_compose_runs_what_the_page_of_containers_asks_for() -> None:
    services = COMPOSE["services"]
    for name in ("server", "worker"):
        assert services[name]["init"] is True
        assert services[name]["cap_drop"] == ["ALL"]
        assert {"seccomp=unconfined", "apparmor=unconfined", "systempaths=unconfined"} < set(
            services[name]["security_opt"]
        )
    assert services["worker"]["deploy"]["replicas"] == 2
    assert services["worker"]["command"] == ["grader", "worker"]
    subnet = COMPOSE["networks"]["default"]["ipam"]["config"][0]["subnet"]
    assert services["server"]["environment"]["GRADER_TRUSTED_PROXIES"] == f'["{subnet}"]'
    environment = services["proxy"]["environment"]
    assert services["server"]["environment"]["GRADER_PUBLIC_ORIGIN"] == f"https://{environment['SITE']}"
    caddy = (DEPLOY / "Caddyfile").read_text()
    assert all(f"{{${name}:" in caddy for name in environment)


def test_the_settings_of_compose_are_settings() -> None:
    for service in ("server", "worker"):
        given = {
            name.removeprefix("GRADER_").lower(): value
            for name, value in COMPOSE["services"][service]["environment"].items()
        }
        assert set(given) <= set(Settings.model_fields)
