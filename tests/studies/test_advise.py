"""Advice on models, by measurement."""

import re
from functools import cache
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from grader.commands.main import main
from grader.errors import ContentError, Unprocessable
from grader.numerics.accuracy.convergence import measure_distance
from grader.numerics.accuracy.reference import list_sample_times
from grader.numerics.integrators import DISCRETE, IMPLICITFAST, INTEGRATORS, RK4
from grader.numerics.rollout import simulate
from grader.studies.advise.meter import SAMPLE_S
from grader.studies.advise.page import draw_page, draw_table
from grader.studies.advise.report import Advice, RunStart, advise, build_scene, find_binding_stiffness, find_energy_loss
from grader.studies.advise.selection import START, Candidate, select
from grader.studies.bench.scenes import find_scene, read_scene
from numerics.models import DELAY, RUNAWAY, TWO_FREE_BODIES, hinge

pytestmark = pytest.mark.slow

FOREIGN = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"

MOVING = RunStart(qpos=[1.0])


@cache
def advice_on_stiff_servo() -> Advice:
    """What several tests look at, made once."""
    return advise(read_scene("stiff_servo"), "data.qpos[0]", tol=0.02, seconds=0.3)


def test_rk4_wins_where_energy_is_conserved_and_every_integrator_was_tried() -> None:
    advice = advise(find_scene("double_pendulum"), "lib.sitePos('tip')[2]", tol=1e-3, seconds=0.5)
    assert advice.choice is not None
    assert advice.choice.integrator == RK4
    assert {c.integrator for c in advice.selection.candidates} == set(INTEGRATORS)
    assert "energy is conserved" in advice.steps[1]
    assert any("constraints" in skip for skip in advice.skips)


def test_rk4_wins_too_where_energy_is_lost() -> None:
    """A damped pendulum: the lesson's procedure would stop at "none" here."""
    advice = advise(hinge("damping='0.1'"), tol=1e-4, seconds=1.0, start=MOVING)
    assert advice.choice is not None
    assert advice.choice.integrator == RK4
    assert "damping" in advice.steps[1]


FLOOR = """<mujoco><option timestep="0.002"/><worldbody><geom type="plane" size="5 5 .1" pos="0 0 {floor}"/>
  <body pos="0 0 1"><joint type="slide" axis="0 0 1"/><geom size=".1" mass="1"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize(("floor", "touches"), [(-9, False), (0.7, True)])
def test_the_reference_is_of_high_order_until_a_constraint_acts(floor: float, touches: bool) -> None:
    said: list[str] = []
    selection = select(
        build_scene(FLOOR.format(floor=floor), RunStart()), tolerance=1e-2, seconds=0.4, progress=said.append
    )
    assert any("a constraint acts" in line for line in said) is touches
    assert any("RK45" in line for line in said) is touches
    assert selection.best is not None
    if not touches:
        # Source: z = -g t^2 / 2. Semi-implicit Euler at h is g t h / 2 off, which the reference must see.
        assert selection.reference_error < 1e-9
        errors = {c.timestep_s: c.error for c in selection.candidates if c.integrator == IMPLICITFAST}
        assert errors[START[1]] == pytest.approx(9.81 * 0.4 * START[1] / 2, rel=1e-6)


def test_stiffness_binds_and_warnings_are_told() -> None:
    advice = advice_on_stiff_servo()
    assert "7.33 ms" in advice.steps[2]
    assert {c.timestep_s for c in advice.selection.candidates if c.warning and c.integrator == RK4} == {0.02}
    assert advice.choice is not None
    assert advice.choice.error <= 0.02


def test_the_models_own_setting_has_a_row_with_what_it_costs() -> None:
    advice = advise(read_scene("servo"), tol=1e-2, seconds=0.5)
    assert advice.selection.own is not None
    assert "(the model's own)" in str(advice)
    assert re.search(r"the model's own setting, Euler at 2 ms, has an error of \S+ and costs", str(advice))


def test_a_cheaper_setting_that_passed_by_accident_is_named() -> None:
    advice = advise(FOREIGN / "inverted_pendulum.xml", tol=1e-3, seconds=2.0)
    errors = {c.setting: c.error for c in advice.selection.candidates}
    assert advice.choice is not None
    assert RK4.evaluations / 0.004 < advice.choice.cost
    assert errors[RK4, 0.004] < 1e-3 < errors[RK4, 0.0025]
    assert "cheaper, but by accident, as a smaller timestep is worse: RK4 at 4 ms" in str(advice)


EQUALITY = """<mujoco><option timestep="0.002"/><worldbody>
  <body pos="0 0 2"><joint name="a" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 1 0 0" size=".02"/></body>
  <body pos="3 0 2"><joint name="b" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 -1 0 0" size=".02"/></body>
  </worldbody><equality><joint joint1="a" joint2="b" polycoef="0 -1 0 0 0"/></equality></mujoco>"""
"""Two arms that mirror each other: RK4 is nearer to the truth than the reference."""


def test_an_error_below_the_uncertainty_of_the_reference_is_printed_as_a_bound() -> None:
    advice = advise(EQUALITY, "data.qpos[0]", tol=1e-3, seconds=1.0)
    selection = advice.selection
    assert advice.choice is not None
    assert advice.choice.error < selection.reference_error
    assert re.search(r"^> RK4 at \S+ ms +< \d\.\de-\d\d ", str(advice), re.MULTILINE)
    assert re.search(r"^RK4 at \S+ ms meets 0.001 with an error below \d", str(advice), re.MULTILINE)
    assert f"<: no larger than this, as the reference is uncertain by {selection.reference_error:.2g}" in str(advice)
    assert sum(c.error < selection.reference_error for c in selection.front) == 1
    assert "&lt; " in draw_table(advice)


def test_the_times_of_comparison_are_told(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    advice = advice_on_stiff_servo()
    assert "compared every 2 ms; what is faster than that may be missed" in str(advice)
    assert "compared every 2 ms" in draw_page(advice, "servo")
    monkeypatch.setattr("sys.argv", ["grader", "advise", "--help"])
    with pytest.raises(SystemExit):
        main()
    assert "every 20 ms" in " ".join(capsys.readouterr().out.split())


def test_columns_stay_in_line() -> None:
    lines = str(advice_on_stiff_servo()).splitlines()
    head = next(line for line in lines if line.endswith("  warning"))
    rows = [line for line in lines if re.match(r"[>* ] \w+ at ", line)]
    assert len(rows) > 10
    for row in rows:
        for word in ("error", "cost", "CPU"):
            end = head.index(word) + len(word)
            assert row[end - 1] != " ", row
            assert row[end] == " ", row


@pytest.mark.parametrize(
    ("model", "quantity", "tol", "seconds", "error"),
    [
        ("<mujoco>", None, None, None, Unprocessable),
        (Path("nowhere.xml"), None, None, None, Unprocessable),
        (read_scene("servo"), "data.qpos[", None, None, ContentError),
        (read_scene("servo"), "data.nothing", None, None, ContentError),
        (read_scene("servo"), "data.qpos[9]", None, None, Unprocessable),
        (read_scene("servo"), None, -1.0, None, Unprocessable),
        (read_scene("servo"), None, None, 0.0, Unprocessable),
        (read_scene("servo"), None, None, 2e7, Unprocessable),
        (read_scene("servo"), None, None, float("inf"), Unprocessable),
        (TWO_FREE_BODIES.replace("<mujoco>", '<mujoco><size memory="20K"/>'), None, None, 3.0, Unprocessable),
    ],
)
def test_what_means_nothing_is_refused(
    model: str | Path, quantity: str | None, tol: float | None, seconds: float | None, error: type[Exception]
) -> None:
    with pytest.raises(error):
        advise(model, quantity, tol, seconds)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (("<option", '<option density="1.2"'), "medium"),
        (('name="elbow" type="hinge"', 'name="elbow" type="hinge" damping="0.1"'), "damping"),
        (('name="elbow" type="hinge"', 'name="elbow" type="hinge" frictionloss="0.1"'), "friction loss"),
    ],
)
def test_what_can_lose_energy_is_told(change: tuple[str, str], why: str) -> None:
    assert find_energy_loss(build_scene(read_scene("double_pendulum"), RunStart())) is None
    reason = find_energy_loss(build_scene(read_scene("double_pendulum").replace(*change), RunStart()))
    assert reason is not None
    assert why in reason


def test_energy_is_a_quantity() -> None:
    advice = advise(find_scene("double_pendulum"), "lib.energy().total", tol=1e-3, seconds=0.2)
    errors = {c.setting: c.error for c in advice.selection.candidates}
    assert errors[START] > 1e-5


@pytest.mark.parametrize(("quantity", "said"), [("model.body_mass[1]", "quantity never"), (None, "positions never")])
def test_an_error_of_what_never_changes_says_nothing(quantity: str | None, said: str) -> None:
    with pytest.raises(Unprocessable, match=said):
        advise(hinge(), quantity, seconds=0.02)


@pytest.mark.parametrize(
    "start", [RunStart(qpos=[1.0]), RunStart(qvel=[2.0]), RunStart(perturb=1.0), RunStart(qpos=[0.5], qvel=[-1.0])]
)
def test_a_start_can_be_set_in_motion(start: RunStart) -> None:
    assert advise(hinge(), seconds=0.2, start=start).choice is not None


@pytest.mark.parametrize(
    ("start", "said"),
    [
        (RunStart(key="nowhere"), "nowhere"),
        (RunStart(key=7), "7"),
        (RunStart(qpos=[1.0, 2.0]), "qpos has 1"),
        (RunStart(ctrl=[1.0]), "ctrl has 0"),
        (RunStart(perturb=float("inf")), "perturb"),
    ],
)
def test_a_start_that_does_not_fit_is_refused(start: RunStart, said: str) -> None:
    with pytest.raises(Unprocessable, match=said):
        advise(hinge(), seconds=0.2, start=start)


@pytest.mark.parametrize(("model", "said"), [(RUNAWAY, "without bound"), (DELAY, "delay")])
def test_what_cannot_be_told_is_said(model: str, said: str) -> None:
    advice = advise(model, seconds=1.0, start=RunStart(perturb=1.0))
    assert (advice.choice, advice.selection.candidates) == (None, ())
    assert f"cannot tell: {'the motion' if model is RUNAWAY else 'a delay'}" in str(advice)
    assert said in str(advice)


@pytest.mark.parametrize("damping", ["0", "0.1"])
def test_what_is_unstable_in_truth_is_no_fault_of_the_step(damping: str) -> None:
    upright = hinge(f"damping='{damping}'").replace("0 0 -0.5", "0 0 0.5")
    advice = advise(upright, tol=1e-2, seconds=0.2, start=RunStart(qpos=[0.1]))
    assert find_binding_stiffness(build_scene(upright, RunStart(qpos=[0.1])), advice.selection.candidates) is None
    everywhere = [Candidate(IMPLICITFAST, h, 1.0, 1.0, warning="mjWARN_BADQACC") for h in (0.001, 0.02)]
    assert find_binding_stiffness(build_scene(RUNAWAY, RunStart()), everywhere) is None


def test_discrete_is_measured_where_a_servo_is_stiff() -> None:
    advice = advise(read_scene("stiff_servo"), "data.qpos[0]", tol=0.9, seconds=0.3)
    assert advice.choice is not None
    assert advice.choice.integrator == DISCRETE


@pytest.mark.parametrize(
    ("options", "status", "said"),
    [
        (["--qpos", "1"], 0, "> "),
        ([], 2, "--perturb"),
        (["--qpos", "1,x"], 2, "separated by commas"),
        (["--qpos", "1", "--budget", "0"], 1, "cannot tell"),
        (["--qpos", "1", "--budget", "-5"], 2, "--budget must be 0 s or more, not -5"),
        (["--qpos", "1", "--budget", "nan"], 2, "--budget must be 0 s or more, not nan"),
        (["--perturb=-1"], 2, "--perturb must be 0 or more and finite, not -1"),
        (["--qpos", "1", "--tol", "1e-15"], 1, "could be told"),
    ],
)
def test_the_command_says_by_its_status_whether_there_is_a_choice(
    options: list[str],
    status: int,
    said: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    model = tmp_path / "hinge.xml"
    model.write_text(hinge())
    monkeypatch.setattr("sys.argv", ["grader", "advise", str(model), "--seconds", "0.2", *options])
    with pytest.raises(SystemExit) as end:
        main()
        raise SystemExit(0)
    printed = capsys.readouterr()
    assert (end.value.code or 0) == status
    assert said in (printed.out if status < 2 else printed.err)


def test_a_choice_for_a_part_of_the_run_has_a_status_of_its_own(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "sys.argv", ["grader", "advise", str(FOREIGN / "walker2d.xml"), "--seconds", "1", "--perturb", "1"]
    )
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 4
    assert re.search(r"^choice: \w+ at \S+ ms, until 0\.\d+ s$", capsys.readouterr().out, re.MULTILINE)


@pytest.mark.parametrize(
    ("name", "tol"),
    [
        ("ant", 0.05),
        ("half_cheetah", 0.05),
        ("hopper", 0.01),
        ("humanoid", 0.02),
        ("humanoidstandup", 0.05),
        ("inverted_double_pendulum", 0.001),
        ("inverted_pendulum", 0.001),
        ("point", 0.01),
        ("pusher_v5", 0.01),
        ("reacher", 0.01),
        ("swimmer", 0.0001),
        ("walker2d_v5", 0.02),
    ],
)
def test_foreign_models_meet_the_tolerance_against_another_method(name: str, tol: float) -> None:
    """The reference of these models steps with implicitfast, or is DOP853; here RK4 takes 25 us."""
    seconds = 0.4
    path, start = FOREIGN / f"{name}.xml", RunStart(perturb=1.0)
    advice = advise(path, tol=tol, seconds=seconds, start=start)
    assert advice.choice is not None, str(advice)
    scene = build_scene(path, start)
    times = np.asarray(list_sample_times(seconds, SAMPLE_S))
    integrator, timestep_s = advice.choice.setting
    chosen, half, truth = (
        simulate(scene, seconds=seconds, timestep_s=h, integrator=code, at_s=times)
        for h, code in ((timestep_s, integrator.code), (5e-5, RK4.code), (2.5e-5, RK4.code))
    )
    assert measure_distance(scene, chosen, truth).qpos <= tol + measure_distance(scene, half, truth).qpos
