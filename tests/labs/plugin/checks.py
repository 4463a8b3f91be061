"""What is special about the `sweep` kind, tried where it is installed: tests/labs/test_plugin.py runs this file."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import mujoco
import numpy as np
import pytest
from playwright.sync_api import expect
from scipy.integrate import solve_ivp

from grader.errors import ContentError
from grader.labs import lab_kinds
from grader.library import load
from grader.settings import Settings
from support.command_line import grader
from support.sites import Site, open_site
from web.browsing import chromium

RUN = "/api/v1/labs:run"
SWEEP = lab_kinds()["sweep"]
EXAMPLE = SWEEP.example()
LAB: dict[str, Any] = {"id": "stop", **EXAMPLE.lab}
TARGET = {"quiz": "sweeps", "lab": "stop"}


def written(root: Path, **changes: Any) -> Path:
    (root / "quizzes").mkdir()
    (root / "models").mkdir()
    for path, text in EXAMPLE.files.items():
        (root / path).write_text(text)
    quiz = {"id": "sweeps", "title": "Sweeps", "labs": [LAB | changes]}
    (root / "quizzes/sweeps.json").write_text(json.dumps(quiz))
    return root


def refused(root: Path, **changes: Any) -> list[tuple[str, str]]:
    with pytest.raises(ContentError) as raised:
        load(written(root, **changes))
    return [(fault.key, fault.why) for fault in raised.value.faults]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    content = written(tmp_path_factory.mktemp("content"))
    with open_site(Settings(content=content, data=tmp_path_factory.mktemp("data"), workers=0)) as site:
        yield site


@pytest.fixture(scope="module")
def ann(site: Site) -> httpx.Client:
    return site.client("ann")


def integrate_swing(damping: float, angle: float, seconds: float) -> float:
    """The same by SciPy, from the equation of a pendulum."""
    model = mujoco.MjModel.from_xml_string(EXAMPLE.files["models/pendulum_of_sweep.xml"])
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    inertia, weight = np.zeros((1, 1)), 1.0 * 9.81 * 0.25
    mujoco.mj_fullM(model, data, inertia)
    moment = inertia[0, 0]
    solved = solve_ivp(
        lambda _, y: [y[1], (-weight * np.sin(y[0]) - damping * y[1]) / moment],
        (0, seconds), [angle, 0.0], rtol=1e-9, atol=1e-9, t_eval=np.linspace(seconds / 2, seconds, 2000),
    )  # fmt: skip
    return float(np.abs(solved.y[0]).max())


def test_sweep_agrees_with_the_equation_of_a_pendulum(ann: httpx.Client) -> None:
    run = ann.post(RUN, json=TARGET | {"controls": {"samples": 4}}).json()
    assert (run["angle"], run["damping"]) == (1, pytest.approx([0.05, 0.45, 0.85, 1.25]))
    expected = [integrate_swing(damping, 1.0, 2.0) for damping in run["damping"]]
    assert run["swings"] == pytest.approx(expected, rel=0.01, abs=2e-3)  # a timestep of 2 ms, of first order


def test_sweep_shows_neither_model_nor_joint(ann: httpx.Client) -> None:
    shown = ann.get("/api/v1/quizzes/sweeps").text
    assert "hinge" not in shown and "pendulum_of_sweep" not in shown


def test_sweep_tells_what_it_takes(ann: httpx.Client) -> None:
    told = {
        json.dumps(controls): ann.post(RUN, json=TARGET | {"controls": controls}).json()["detail"]
        for controls in ({"angle": 2}, {"samples": 51}, {"mass": 1}, {"samples": "many"})
    }
    assert told == {
        '{"angle": 2}': "angle must be a number from 0.1 to 1.5 rad.",
        '{"samples": 51}': "samples: must be less than or equal to 50.",
        '{"mass": 1}': "There is no setting 'mass' here; the settings are: angle, samples.",
        '{"samples": "many"}': "samples: must be a valid integer.",
    }
    for more in ({"events": [[0, "go"]]}, {"seconds": 1}):
        answer = ann.post(RUN, json=TARGET | more)
        assert (answer.status_code, "no buttons" in answer.json()["detail"]) == (422, True)


def test_sweep_that_is_too_dear_is_refused_when_it_is_loaded(tmp_path: Path) -> None:
    faults = refused(tmp_path, seconds=20)
    why = "This run takes more than 100000 steps: ask for less in one run."
    assert faults == [("stop", f"{why} (with angle = 0.1, samples = 50)")]


@pytest.mark.parametrize(
    ("changes", "key", "why"),
    [
        ({"damping": [1, 0]}, "stop.damping", "write the smaller end first"),
        ({"damping": [-1, 0]}, "stop.damping.0", "damping is 0 or more"),
        ({"angle": 3}, "stop.angle", "is not from 0.1 to 1.5"),
        ({"samples": 51}, "stop.samples", "less than or equal to 50"),
        ({"joint": "knee"}, "stop", "The model has no hinge 'knee'"),
        ({"model": "sweep"}, "stop.model", "there is no models/sweep.xml"),
    ],
)
def test_sweep_tells_its_author_what_is_wrong(tmp_path: Path, changes: dict[str, Any], key: str, why: str) -> None:
    ((at, told),) = refused(tmp_path, **changes)
    assert at == key
    assert why in told


@pytest.mark.process
def test_sweep_passes_grader_check(tmp_path: Path) -> None:
    done = grader("check", str(written(tmp_path)))
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.browser
def test_sweep_draws_its_curve_again_when_the_angle_changes(site: Site) -> None:
    with chromium() as browser:
        page = browser.new_context(base_url=site.origin).new_page()
        page.goto("/")
        box = page.locator('[data-lab-id="stop"]')
        message, line = box.locator("[data-message]"), box.locator(".strips .line")
        expect(message).to_have_text(re.compile(r"^11 runs from 1 rad: .* rad under the least damping"), timeout=20_000)
        expect(line).to_have_count(1)
        before = line.get_attribute("d")
        assert before is not None
        assert len(re.findall("[ML]", before)) == 11
        box.get_by_label("angle at the start").fill("0.5")
        box.get_by_label("angle at the start").press("Tab")
        expect(message).to_have_text(re.compile("^11 runs from 0.5 rad"))
        assert line.get_attribute("d") != before
        box.get_by_label("angle at the start").fill("7")
        box.get_by_label("angle at the start").press("Tab")
        expect(message).to_have_text("angle at the start must be from 0.1 to 1.5.")
        expect(message).to_have_class(re.compile(r"\bno\b"))
