"""No figure on a page is typed by hand: tables are renderings of the committed JSON, and so is what sentences say.

A claim is a part of a sentence that `grader.studies.bench.published.claims` renders from the results or denies, or that
is simulated here. What the claims leave of the pages holds no number and no superlative.
"""

import json
import re
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grader.numerics.accuracy.convergence import fit_order
from grader.numerics.integrators import BY_NAME
from grader.numerics.stability.servo import Servo
from grader.studies.bench.errors import impacts
from grader.studies.bench.physics import precision, stability
from grader.studies.bench.physics.collisions import CASES
from grader.studies.bench.published import error_tables, measured
from grader.studies.bench.published.claims import CLAIMS
from grader.studies.bench.published.measured import (
    CLAIMED,
    MARKED,
    PICTURE,
    STUDIES,
    fill,
    load_results,
    main,
)
from grader.studies.bench.published.other import OTHER, REPEATED, describe_bits, describe_rows
from grader.studies.bench.published.tables import BLOCKS
from grader.studies.bench.scenes import load_scene
from studies.active_set import CONSTANT, order

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "docs" / "measured"
PAGE = "docs/measured.md"
PAGES = (PAGE, "docs/deploy.md")
RESULTS = load_results(KEPT)
SCENES = RESULTS["precision"]["scenes"]

COUNTS = "two|three|four|five|six|seven|eight|nine|ten|half|twice|third|quarter|fifth|hundred|thousand"
ABSOLUTE = "most|least|best|worst|every|each|never|always|nothing|none|nowhere|only|any|no"
SUPERLATIVE = r"(?!(?:re)?quest|tests?|rest)\w{2,}est"
NUMBER = re.compile(rf"(?<![\w.])\d|\b(?:{COUNTS}|{ABSOLUTE}|{SUPERLATIVE})\b", re.IGNORECASE)


def test_the_results_are_of_whole_runs_and_no_proof_was_broken() -> None:
    assert not any(RESULTS[name]["quick"] for name in STUDIES)
    assert RESULTS["skip"]["broken_proofs"] == []
    assert all(scene["bitwise"] for scene in RESULTS["skip"]["scenes"].values())
    assert RESULTS["precision"]["profiling_timer"] is True
    for scene in SCENES.values():
        assert all(error in scene["errors"][method] for method, _, _, error in scene["pareto"])


@pytest.mark.parametrize("page", PAGES)
def test_the_page_is_the_rendering_of_the_results(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert MARKED.search(text), f"{page} has no <!-- measured:begin NAME --> ... <!-- measured:end NAME -->"
    filled, denied = fill(text, RESULTS)
    assert not denied, "\n".join(denied)
    assert filled == text, "run: make measured-tables"


def test_the_pages_use_every_block_claim_and_picture() -> None:
    text = "\n".join((ROOT / page).read_text(encoding="utf-8") for page in PAGES)
    assert {match[1] for match in MARKED.findall(text)} == set(BLOCKS)
    assert sorted(match[1] for match in CLAIMED.findall(text)) == sorted(CLAIMS)
    assert not re.search(r"^ *<!--=", text, re.MULTILINE), "Markdown takes such a line for HTML"
    pictures = {path.name: path.stat().st_size for path in KEPT.glob("*.png")}
    assert set(PICTURE.findall(text)) == set(pictures)
    assert min(pictures.values()) > 10_000


def test_another_figure_is_noticed() -> None:
    page = "<!-- measured:begin skip -->\nold\n<!-- measured:end skip -->\n"
    filled, _ = fill(page, RESULTS)
    assert "old" not in filled
    assert fill(filled, RESULTS) == (filled, [])


def test_the_other_version_has_its_rows_where_they_differ() -> None:
    table = "| a | b |\n|---|---|\n| x | 1 |\n| y | 2 |"
    assert describe_rows(table, table).endswith("the same figures in every row.")
    differing = describe_rows(table, table.replace("2", "3"))
    assert "its other 1 rows are the same" in differing
    assert differing.endswith("| a | b |\n|---|---|\n| y | 3 |")


def test_bits_that_differ_are_named_with_scene_and_integrator() -> None:
    digests = {"cube": dict.fromkeys(BY_NAME, "a"), "servo": dict.fromkeys(BY_NAME, "b")}
    changed = {"cube": digests["cube"] | {"RK4": "c"}, "servo": digests["servo"]}
    versions = {"3.14.0": {"digests": digests}, OTHER: {"digests": changed}}
    assert describe_bits(("cube", "servo"), versions).endswith("except under RK4 on cube.")
    assert describe_bits(("servo",), versions).endswith("to the last bit, under every integrator.")


def test_the_other_version_was_measured_with_itself() -> None:
    assert set(RESULTS["other"]) <= set(REPEATED)
    for one in RESULTS["other"].values():
        assert (one["versions"]["mujoco"], one["quick"]) == (OTHER, False)


def with_times(results: Any, factor: Callable[[], float]) -> Any:
    """The results with every measured time and ratio of times multiplied."""
    if isinstance(results, list):
        return [with_times(result, factor) for result in results]
    if not isinstance(results, dict):
        return results
    timed = {"ratio", "fixed_us", "reset_us"}
    return {
        name: one * factor() if name in timed and one is not None else with_times(one, factor)
        for name, one in results.items()
    }


def test_the_sentences_hold_when_the_same_is_measured_again() -> None:
    page, rng = (ROOT / PAGE).read_text(encoding="utf-8"), np.random.default_rng(0)
    for _ in range(5):
        again = with_times(RESULTS, lambda: float(np.exp(rng.normal(0, 0.03))))
        filled, denied = fill(page, again)
        assert not denied, "\n".join(denied)
        assert filled != page
        assert fill(filled, again) == (filled, [])


def test_a_sentence_that_the_results_deny_is_named_and_left(tmp_path: Path) -> None:
    """Everything else on the page is rendered; the message has the sentence, and what was measured."""
    slower = with_times(RESULTS, lambda: 1.0)
    for scene in slower["precision"]["scenes"].values():
        scene["procedure"]["four_times"]["ratio"] = 1.25
    (tmp_path / "measured").mkdir()
    for name, one in slower.items():
        (tmp_path / "measured" / f"{name}.json").write_text(json.dumps(one))
    page, claim = tmp_path / "page.md", "<!--=four_times--> RK4 at 8 ms costs less<!--=-->"
    page.write_text(f"1. Here{claim}; <!--=quarter-->old<!--=-->\n")
    with pytest.raises(SystemExit) as end:
        main(tmp_path, [page], tables_only=True)
    assert "the page says: RK4 at 8 ms costs less\n  the results show: costs of RK4 at 8 ms" in str(end.value)
    assert "1.25" in str(end.value)
    assert claim in " ".join(page.read_text().split())
    assert "old" not in page.read_text()


def test_nothing_is_measured_where_a_peer_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measured, "find_spec", lambda _module: None)
    with pytest.raises(SystemExit, match="Pinocchio, Drake"):
        main(tmp_path, [])
    assert not list(tmp_path.iterdir())


def order_kept() -> str:
    (kept,) = {round(order(name, "RK4")) for name in CONSTANT}
    return f"it keeps order {kept}"


def box() -> str:
    case, start = CASES["box"], load_scene(CASES["box"].scene)
    assert all(one["shares"]["warned"] == 0 for one in RESULTS["stability"]["cases"]["box"].values())
    for integrator in BY_NAME:
        for timestep_s in (1e-3, case.timestep_span_s[0]):
            assert case.outcome(case.follow(case.start(start, 0.01), 0.01, integrator, timestep_s)) == "launched"
    return "is thrown out without any warning, and no smaller timestep prevents it"


def scope() -> str:
    assert (len(BY_NAME), len(precision.TIMESTEPS_S), len(precision.SCENES)) == (5, 10, 7)
    assert list(SCENES) == list(precision.SCENES)
    return f"over {RESULTS['precision']['horizon_s']} s (sup norm; rotations as rotation vectors) against CPU time, for"


@cache
def averaged() -> str:
    """The root mean square of the errors over starts whose impacts fall at other phases of a step."""
    timesteps_s = [0.008 / 2**k for k in range(7)]
    squares: dict[str, list[list[float]]] = {"RK4": [], "Euler": []}
    for number in range(8):
        scene = load_scene("joint_limits").at(qpos=[1.5 + 0.003 * number, 0.5])
        truth, _, _ = precision.through_impacts(scene)
        for integrator, errors in squares.items():
            settings = [precision.Setting("joint_limits", integrator, h) for h in timesteps_s]
            errors.append([setting.error(truth, scene)["error"] ** 2 for setting in settings])
    fits = {name: fit_order(timesteps_s, np.sqrt(np.mean(errors, axis=0))) for name, errors in squares.items()}
    assert all(fit.high - fit.low < 0.3 for fit in fits.values())
    return (
        f"Averaged over {len(squares['RK4'])} starts, whose impacts fall at other phases of a step, RK4 shows order "
        f"{fits['RK4'].order:.1f} on the limits, and Euler {fits['Euler'].order:.1f}."
    )


def servo_limits(values: Any) -> list[Servo]:
    return [Servo(stability.PENDULUM_INERTIA, 100, kv, stability.PENDULUM_GRAVITY_STIFFNESS) for kv in values]


def damping() -> str:
    assert stability.CHARTS["damping"].servo(5.0) == servo_limits([5.0])[0]
    servos = servo_limits(np.geomspace(0.5, 100, 60))
    assert all(a.euler_s > b.euler_s and a.implicit_s < b.implicit_s for a, b in pairwise(servos))
    beyond = servo_limits([40, 80])
    assert beyond[1].rk4_s / beyond[0].rk4_s == pytest.approx(beyond[1].euler_s / beyond[0].euler_s, rel=0.05)
    critical = 2 * (servos[0].inertia * servos[0].stiffness) ** 0.5
    limits = [servo.rk4_s for servo in servo_limits(np.linspace(0.5, critical, 100))]
    assert max(limits) / min(limits) - 1 < 0.14
    assert 1 - min(limits) / max(limits) < 0.125
    return f"stays within {100 * (1 - min(limits) / max(limits)):.0f} % up to critical damping, and then falls as fast"


def horizon() -> str:
    assert stability.SECONDS == 3
    longest = stability.CHARTS["damping"].timestep_span_s[1]
    return f"at {1e3 * longest:.0f} ms, 3 s are {stability.SECONDS / longest:.0f} steps"


def ball_and_wall() -> str:
    model = load_scene("ball_and_wall").model
    ball = min(size[0] for kind, size in zip(model.geom_type, model.geom_size, strict=True) if kind == 2)
    wall = min(size[0] for kind, size in zip(model.geom_type, model.geom_size, strict=True) if kind == 6)
    return f"a ball of {100 * ball:g} cm radius that flies at a wall {200 * wall:g} cm thick"


def pushed() -> str:
    case, scene = CASES["ball"], load_scene(CASES["ball"].scene)
    for integrator in BY_NAME:
        for timestep_s in (1e-3, 1e-4):
            outcomes = {
                speed: case.outcome(case.follow(case.start(scene, speed), speed, integrator, timestep_s))
                for speed in (3, 4, 10, 100)
            }
            assert outcomes.pop(3) == "stopped"
            assert set(outcomes.values()) == {"pushed through"}  # and not tunnelled, as at larger timesteps
    assert all(one["shares"]["tunnelled"] > 0.1 for one in RESULTS["stability"]["cases"]["ball"].values())
    return "from 4 m/s on the ball is pushed through the wall at 1 ms and at 0.1 ms alike"


def three_servos() -> str:
    assert len(RESULTS["regions"]["servos"]) == 3
    return "the pendulum's servo at three stiffnesses"


def ten_minutes() -> str:
    assert RESULTS["energy"]["minutes"] == 10
    assert list(RESULTS["energy"]["scenes"]) == ["double_pendulum", "spinning_body"]
    return "over ten minutes"


SIMULATED: tuple[Callable[[], str], ...] = (
    *(order_kept, box, scope, averaged, damping, horizon, ball_and_wall, pushed, three_servos, ten_minutes),
)
"""What is simulated here, or said of a scene, and so does not depend on the results."""

DEFINITIONS = (
    "Every table on this page",
    "answers of every kind that is graded at once",
    "every second number is one that nobody has typed before",
    "beside two bare routes of FastAPI",
    "as one row; it asks nobody who they are, grades nothing and keeps no result. One commits each row",
    "The three servers take turns",
    "No warning",
    "no warning",
    "A box started a centimetre inside",
    "five integrators at ten timesteps on seven scenes",
    "the largest position error",
    "nothing is both cheaper and more precise",
    "The cheapest setting within each error",
    "(Euler at 2 ms)",
    "RK4 at a quarter of its timestep",
    "at four times its timestep",
    "with its 95 % interval",
    "its own error is its largest distance to a second solution",
    "no noise",
    "nothing skipped",
    "MuJoCo's cheapest setting, each at its cheapest within the error",
    "of second order",
    "with kv = 5, started at 1 rad, simulated for 3 s at each timestep",
    "of the one-step map is 1,",
    "2 sqrt(I/kp)",
    "kp = 100",
    "over its two parameters",
    "grid of each second row and column",
    "touches no wall",
    "each part of the engine",
    "that no force depends on",
    "no flag of MuJoCo leaves their poses out",
    "Each flag alone",
    "The cheapest setting within each position error over 1.024 s",
    "its 95 % confidence interval",
    "each measured beside the one before",
    "(each with its conjugate)",
    "Energy over ten minutes",
    "at its first warning",
    "one limit or one pair of geoms",
    "a single eigenvalue",
    "(#energy-over-ten-minutes)",
    "`make measured MUJOCO=4.0.0` for what has no times",
    "what MuJoCo 4.0.0 does otherwise; [its page](mujoco-4.md)",
    "the 95 % bound of RK4 lies at",
    "Skipping helps where nothing touches",
    "the table has them at 2 ms",
    "the band up to 95 %",
    "at other phases of a step in each",
    "below half the time constants",
    "from Python at each evaluation or step",
)
"""What a measurement is, not what it found: the settings in it are asserted in the test below."""


def prose() -> str:
    """The sentences of the page, on one line: without blocks, pictures and commands."""
    text = (ROOT / PAGE).read_text(encoding="utf-8")
    text = re.sub(r"^\d+\. ", "", CLAIMED.sub(" ", MARKED.sub("", text)), flags=re.MULTILINE)
    return " ".join(re.sub(r"!\[[^]]*]\([^)]*\)|\([\w./]*\.\w+\)", "", text).replace("*", "").split())


def test_what_a_measurement_is_stands_in_the_code() -> None:
    charts = stability.CHARTS
    assert charts["stiffness"].servo(100.0) == servo_limits([5.0])[0]
    assert load_scene("servo").start.qpos.tolist() == [1.0]
    assert precision.YARDSTICK == ("Euler", 0.002)
    assert precision.PROCEDURE == {
        "start": ("implicitfast", 0.002),
        "quarter": ("RK4", 0.0005),
        "four_times": ("RK4", 0.008),
    }
    assert precision.HORIZON_S == RESULTS["precision"]["horizon_s"] == 1.024
    assert (error_tables.SHOWN_S, impacts.PERCENT, OTHER) == (0.002, 95, "4.0.0")


@pytest.mark.parametrize(
    "claim",
    [pytest.param(claim, marks=[pytest.mark.slow] if claim is averaged else []) for claim in SIMULATED],
    ids=lambda claim: claim.__name__,
)
def test_the_page_says_what_is_simulated_here(claim: Callable[[], str]) -> None:
    assert claim() in prose()


@pytest.mark.slow
def test_no_number_or_superlative_is_left_without_a_claim() -> None:
    text = prose()
    for part in sorted((*DEFINITIONS, *(claim() for claim in SIMULATED)), key=len, reverse=True):
        text = text.replace(part, "")
    left = [text[max(0, match.start() - 50) : match.end() + 30] for match in NUMBER.finditer(text)]
    assert not left, "\n".join(left)


@pytest.mark.parametrize(
    "sentence", ["It saves 3 times.", "It is the fastest.", "It never fails.", "It takes ten runs."]
)
def test_a_new_number_or_superlative_is_noticed(sentence: str) -> None:
    assert NUMBER.search(sentence)
    assert not NUMBER.search("RK4 and DOP853 are tested at the rest.")
