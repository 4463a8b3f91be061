"""Labs, run for real: the lesson's own, and made-up ones for everything that a config can say."""

import gc
import gzip
import json
import math
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from grader.domain.lab import LabConfig
from grader.errors import LabError, LabRefused
from grader.expressions import Machine
from grader.labs import LabRun, check_lab, run_lab
from grader.labs.runs import LabSimulation
from grader.numerics.workspace import Workspace
from grader.questions import Quiz
from grader.questions.kinds.predict import PredictQuestion

ROOT = Path(__file__).parents[2]
PENDULUM = (ROOT / "models/pendulum.xml").read_text()
SERVO = (ROOT / "models/pendulum_servo.xml").read_text()
BOX = (ROOT / "models/tumbling_box.xml").read_text()


TRACES = [{"label": "angle", "expr": "data.qpos[0]"}]


def lab(**keys: Any) -> LabConfig:
    return LabConfig.model_validate({"model": "pendulum", **keys})


def question_3() -> LabConfig:
    quiz = json.loads((ROOT / "quizzes/1.3-check.json").read_text())
    sim = LabConfig.model_validate(quiz["questions"][2]["sim"])
    assert "implicitfast" in str(sim.controls)
    return sim


def final(run: LabRun, index: int = 0) -> Any:
    return run.to_json()["readouts"][index]["final"]["value"]


def slider(label: str = "x", **keys: Any) -> dict[str, Any]:
    return {"label": label, "min": 0, "max": 10, "step": 0.5, "value": 1, **keys}


def test_the_labs_of_the_lesson_have_no_fault() -> None:
    labs = Quiz.model_validate(json.loads((ROOT / "quizzes/1.3-labs.json").read_text())).labs
    assert isinstance(labs[1], LabConfig)
    assert check_lab(labs[1], SERVO, "servo-stability") == []
    assert check_lab(question_3(), SERVO, "q3.sim") == []


@pytest.mark.parametrize(("integrator", "stable"), [("Euler", False), ("implicitfast", False), ("discrete", True)])
def test_question_3_shows_what_its_explanation_says(integrator: str, stable: bool) -> None:
    run = run_lab(question_3(), SERVO, {"integrator": integrator})
    assert run.stable is stable
    assert stable or run.warnings[0].kind == "BADQACC"
    assert abs(final(run, 1)) < 1e-3
    assert run.duration_s == pytest.approx(10.0)


def test_after_a_warning_the_pendulum_hangs_still_and_the_lab_goes_on() -> None:
    shown = run_lab(question_3(), SERVO, {"integrator": "implicitfast"}).to_json()
    warned = shown["warnings"][0]["time"]
    after = [i for i, t in enumerate(shown["times"]) if t > warned]
    assert 0.03 < warned < 0.2
    assert shown["times"][-1] == 10.0
    assert shown["readouts"][0]["final"]["value"] < 10.0
    assert all(abs(shown["readouts"][1]["values"][i]) < 1e-9 for i in after)


def test_the_lesson_s_servo_lab_shows_the_lesson_s_limits() -> None:
    config = Quiz.model_validate(json.loads((ROOT / "quizzes/1.3-labs.json").read_text())).labs[1]
    assert isinstance(config, LabConfig)
    run = run_lab(config, SERVO, {"stiffness kp": 20000, "damping kv": 60})
    texts = [readout["final"]["text"] for readout in run.to_json()["readouts"]]
    assert texts[:2] == ["7.07", "8.34"]
    assert run_lab(config, SERVO, {"damping kv": 0}).to_json()["readouts"][1]["final"] == {
        "text": "Infinity",
        "value": None,
    }


def test_a_lab_without_controls_shows_a_tumbling_box() -> None:
    config = LabConfig.model_validate({"model": "tumbling_box", "key": 0, "height": 220})
    assert check_lab(config, BOX, "q.sim") == []
    shown = run_lab(config, BOX).to_json()
    assert shown["geoms"] == [
        {"name": "box", "type": "box", "size": [0.05, 0.15, 0.3], "rgba": [0.25, 0.45, 0.7, 1.0], "body": "box"}
    ]
    assert len(shown["times"]) == 189
    up = [1 - 2 * (q[4] ** 2 + q[5] ** 2) for (q,) in shown["frames"]]
    assert min(up) < -0.5 < 0.9 < max(up)


def record_by_hand(model: mujoco.MjModel, data: mujoco.MjData) -> bytes:
    """Step, keep every second pose and energy, and compress: the lab's run as a short loop, without its promises."""
    mujoco.mj_resetData(model, data)
    frames, energies = [], []
    for _ in range(501):
        frames.append(np.round(np.hstack([data.geom_xpos, data.geom_xmat]), 4).tolist())
        energies.append(float(data.energy[0] + data.energy[1]))
        mujoco.mj_step(model, data, nstep=2)
    return gzip.compress(json.dumps({"frames": frames, "energies": energies}).encode(), 5)


@pytest.mark.cost
def test_a_lab_run_costs_little_more_than_a_loop_by_hand() -> None:
    """A run of 1,000 steps with 501 frames, as JSON and compressed, beside a loop of Python that records as much.

    Both are Python around MuJoCo: their ratio hardly depends on the processor. Measured:
    2.2. Not quite twice that is allowed.
    """
    config = question_3()
    model = mujoco.MjModel.from_xml_string(SERVO)
    data = mujoco.MjData(model)
    ours, by_hand = [], []
    for _ in range(20):
        began = time.process_time()
        packed = gzip.compress(json.dumps(run_lab(config, SERVO).to_json()).encode(), 5)
        ours.append(time.process_time() - began)
        began = time.process_time()
        record_by_hand(model, data)
        by_hand.append(time.process_time() - began)
    assert len(packed) < 5_000
    assert min(ours) < 4 * min(by_hand)


def test_a_run_is_the_same_bit_for_bit() -> None:
    first, second = (run_lab(question_3(), SERVO, {"stiffness kp": 500}) for _ in range(2))
    assert first.readouts == second.readouts
    assert [x.tobytes() for x, _ in first.poses] == [x.tobytes() for x, _ in second.poses]


def test_a_run_leaves_no_data_to_the_garbage_collector() -> None:
    config = lab(setup="data.qpos[0] = 2", controller="data.ctrl[0] = 1", stopAt="data.time > 1",
                 readouts=[{"label": "q", "expr": "data.qpos[0]"}])  # fmt: skip
    run_lab(config, PENDULUM)
    gc.collect()
    gc.disable()
    try:
        before = count_data_holders()
        run_lab(config, PENDULUM)
        assert count_data_holders() == before
    finally:
        gc.enable()


def count_data_holders() -> int:
    return sum(isinstance(one, Machine | Workspace | LabSimulation) for one in gc.get_objects())


@pytest.mark.slow
def test_runs_in_many_threads_do_not_meet() -> None:
    settings = [{"stiffness kp": kp, "timestep h": 0.002} for kp in (50, 500, 5000) * 8]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda controls: run_lab(question_3(), SERVO, controls).readouts, settings))
    alone = [run_lab(question_3(), SERVO, controls).readouts for controls in settings[:3]]
    assert together == alone * 8
    assert len({readouts[1] for readouts in alone}) == 3


def test_a_run_through_c_and_a_run_with_an_idle_controller_are_the_same() -> None:
    plain = lab(setup="data.qpos[0] = 2", readouts=[{"label": "q", "expr": "data.qpos[0]"}])
    watched = plain.model_copy(update={"controller": "ctx.n = (ctx.n || 0) + 1"})
    assert run_lab(plain, PENDULUM).readouts == run_lab(watched, PENDULUM).readouts


def test_set_apply_and_param_reach_model_and_ctx_before_setup() -> None:
    config = lab(
        controls=[
            slider("h", set="model.opt.timestep", min=0.001, max=0.01, step=0.001, value=0.004),
            slider("damping", apply="for (let i = 0; i < model.nv; i++) model.dof_damping[i] = value / (i + 1)"),
            slider("angle", param="angle"),
        ],
        setup="data.qpos[0] = ctx.angle; ctx.seen = model.dof_damping[0]",
        readouts=[{"label": l, "expr": l} for l in ("ctx.angle", "ctx.seen", "model.opt.timestep")],
    )
    run = run_lab(config, PENDULUM, {"damping": 3.5, "angle": 0.5}, seconds=0.1)
    assert [final(run, i) for i in range(3)] == [0.5, 3.5, 0.004]


def test_init_controls_are_written_again_after_setup() -> None:
    control = slider("angle", apply="data.qpos[0] = value")
    shown = {"setup": "data.qpos[0] = 3", "readouts": [{"label": "q", "expr": "data.qpos[0]"}]}
    without = run_lab(lab(controls=[control], **shown), PENDULUM, {"angle": 2}, seconds=0.1)
    with_init = run_lab(lab(controls=[{**control, "init": True}], **shown), PENDULUM, {"angle": 2}, seconds=0.1)
    assert without.readouts[0][0] == 3.0
    assert with_init.readouts[0][0] == 2.0


def test_a_button_is_an_event_in_time() -> None:
    config = lab(
        controls=[{"type": "button", "label": "kick", "run": "data.qvel[0] += 1; ctx.at = data.time"}],
        readouts=[{"label": "v", "expr": "data.qvel[0]"}, {"label": "at", "expr": "ctx.at ?? 'never'"}],
    )
    kicked = run_lab(config, PENDULUM, events=[(0.5, "kick")], seconds=1)
    times = kicked.times
    first = next(i for i, v in enumerate(kicked.readouts[0]) if v != 0.0)
    assert times[first] == pytest.approx(0.5, abs=0.002)
    assert final(kicked, 1) == pytest.approx(0.5, abs=0.002)
    assert run_lab(config, PENDULUM, seconds=1).to_json()["readouts"][1]["final"] == {"text": "never", "value": None}


def test_a_controller_runs_before_every_step() -> None:
    config = lab(
        setup="data.qpos[0] = 0.5",
        controller="ctx.n = (ctx.n || 0) + 1; data.ctrl[0] = -2 * data.qpos[0] - 0.5 * data.qvel[0]",
        readouts=[{"label": "n", "expr": "ctx.n"}, {"label": "q", "expr": "data.qpos[0]"}],
    )
    run = run_lab(config, PENDULUM, seconds=4)
    assert final(run, 0) == run.steps == 2000
    assert abs(final(run, 1)) < 0.1


def test_stop_at_is_a_time_or_a_condition() -> None:
    assert run_lab(lab(stopAt=0.4), PENDULUM).duration_s == pytest.approx(0.4)
    falling = lab(key=0, stopAt="data.qpos[0] < 0")
    assert 0.3 < run_lab(falling, PENDULUM).duration_s < 1.0


def test_plots_trails_and_reference_lines() -> None:
    config = lab(
        key=0,
        plots=[
            {
                "ylabel": "rad",
                "window": 2,
                "refLines": [0.5, {"expr": "model.nv + 1", "label": "dof"}],
                "traces": [
                    {"label": "q", "expr": "data.qpos[0]"},
                    {"label": "v", "expr": "data.qvel[0]", "dash": True},
                ],
            }
        ],
        trail={"site": "tip"},
    )
    shown = run_lab(config, PENDULUM).to_json()
    plot = shown["plots"][0]
    assert shown["duration"] == 2.0
    assert plot["refLines"] == [0.5, {"expr": "model.nv + 1", "label": "dof", "y": 2.0}]
    assert [trace["label"] for trace in plot["traces"]] == ["q", "v"]
    assert len(plot["traces"][0]["values"]) == len(shown["trail"]) == len(shown["times"])
    assert shown["trail"][0] == pytest.approx([-0.5, 0.0, 1.0], abs=1e-9)


def test_readouts_have_their_digits() -> None:
    exprs = {"Math.PI": 2, "'text'": None, "1 / 3": None, "model.nv > 0": None, "ctx.none": 1}
    config = lab(readouts=[{"label": e, "expr": e, "digits": d} for e, d in exprs.items()])
    texts = [r["final"]["text"] for r in run_lab(config, PENDULUM, seconds=0.1).to_json()["readouts"]]
    assert texts == ["3.14", "text", "0.333", "true", "undefined"]


def test_energy_of_the_library_is_mujoco_s() -> None:
    config = lab(key=0, readouts=[{"label": "E", "expr": "lib.energy().total", "digits": 6}])
    run = run_lab(config, PENDULUM)
    energies = [float(str(e)) for e in run.readouts[0]]
    assert energies[0] == pytest.approx(9.81, abs=1e-9)
    assert max(energies) - min(energies) < 0.05


@pytest.mark.parametrize(
    ("controls", "why"),
    [
        ({"kp": 20000}, "no control 'kp'"),
        ({"stiffness kp": 5}, "stiffness kp must be a number from 10 to 40000."),
        ({"stiffness kp": math.nan}, "stiffness kp must be a number"),
        ({"stiffness kp": "100"}, "stiffness kp must be a number"),
        ({"stiffness kp": True}, "stiffness kp must be a number"),
        ({"stiffness kp": None}, "stiffness kp must be a number"),
        ({"stiffness kp": 10**400}, "stiffness kp must be a number"),
        ({"timestep h": 0.0015}, "in steps of 0.001"),
        ({"integrator": "RK4"}, "integrator must be one of: Euler, implicitfast, discrete."),
        ({"integrator": 1}, "integrator must be one of"),
        ({"integrator": False}, "integrator must be one of"),
    ],
)
def test_control_values_that_are_not_allowed_are_refused(controls: dict[str, Any], why: str) -> None:
    with pytest.raises(LabRefused, match=why.replace(".", r"\.")):
        run_lab(question_3(), SERVO, controls)


def test_events_and_lengths_that_are_not_allowed_are_refused() -> None:
    config = lab(controls=[{"type": "button", "label": "kick", "run": "data.qvel[0] = 1"}])
    for events, seconds in [([(0.1, "push")], 1.0), ([(2.0, "kick")], 1.0), ([(-1.0, "kick")], 1.0), ([], 0.0)]:
        with pytest.raises(LabRefused):
            run_lab(config, PENDULUM, events=events, seconds=seconds)
    with pytest.raises(LabRefused):
        run_lab(config, PENDULUM, seconds=1e9)


@pytest.mark.parametrize(
    ("keys", "key", "why"),
    [
        ({"setup": "data.qpos[0] = "}, "q.sim.setup", "line 1, column"),
        ({"setup": "data.qpos[0] = 1;\ndata.qpos[9] = 1"}, "q.sim.setup", "line 2, column 1: index 9 is outside"),
        ({"controller": "data.ctrll[0] = 1"}, "q.sim.controller", "column 1: data.ctrll cannot be read"),
        ({"controls": [slider(set="model.opt.timestp")]}, "q.sim.controls.0.set", "cannot be assigned"),
        ({"controls": [slider(set="2")]}, "q.sim.controls.0.set", "is not a path"),
        ({"controls": [slider()]}, "q.sim.controls.0", "changes nothing"),
        ({"controls": [slider(param="k", value=11)]}, "q.sim.controls.0.value", "11 is outside 0..10"),
        ({"controls": [slider(param="k", min=20)]}, "q.sim.controls.0.min", "min must be below max"),
        ({"controls": [slider(param="a"), slider(param="b")]}, "q.sim.controls.1.label", "two controls"),
        ({"controls": [slider(set="model.opt.timestep")]}, "q.sim.controls.0.set", "must be from 1e-06 to 10 (with x"),
        ({"controls": [slider(apply="data.qpos[value] = 1", value=0)]}, "q.sim.controls.0.apply", "with x = 10"),
        (
            {"controls": [{"type": "select", "label": "s", "param": "s", "options": [["a", 1]], "value": 2}]},
            "q.sim.controls.0.value",
            "no option",
        ),
        ({"controls": [{"type": "button", "label": "b", "run": "lib.nothing()"}]}, "q.sim.controls.0.run", "not avail"),
        ({"key": 5}, "q.sim.key", "no key 5"),
        ({"key": "up"}, "q.sim.key", "no key 'up'"),
        ({"readouts": [{"label": "r", "expr": "lib.sitePos('top')"}]}, "q.sim.readouts.0.expr", "no site named 'top'"),
        ({"plots": [{"traces": [{"label": "t", "expr": "1 +"}]}]}, "q.sim.plots.0.traces.0.expr", "line 1, column 4"),
        ({"trail": {"site": "top"}}, "q.sim.trail", "no site named"),
        ({"trail": {"of": "tip"}}, "q.sim.trail", "names no point"),
        ({"stopAt": "data.qpos[0] >"}, "q.sim.stopAt", "line 1"),
        ({"stopAt": "3"}, "q.sim.stopAt", "write a time without the quotes"),
        ({"setup": "model.opt.timestep = 1e-6"}, "q.sim.seconds", "take fewer seconds or a larger timestep"),
        ({"xml": "x"}, None, ""),
    ],
)
def test_what_is_wrong_with_a_lab_is_told_when_it_is_loaded(keys: dict[str, Any], key: str | None, why: str) -> None:
    faults = check_lab(lab(**keys), PENDULUM, "q.sim")
    if key is None:
        assert faults == []
        return
    assert key in [fault.key for fault in faults], faults
    assert any(why in fault.why for fault in faults), faults


def test_a_readout_that_fails_shows_a_dash_and_the_run_goes_on() -> None:
    config = lab(
        controls=[slider("n", param="n", value=1, step=1, max=3)],
        readouts=[{"label": "r", "expr": "ctx.n > 1 && data.time > 0.5 ? lib.qpos('none') : 2"}],
        plots=[{"window": 1, "refLines": [{"expr": "ctx.n > 1 ? lib.qpos('none') : 1"}], "traces": [TRACE]}],
    )
    assert check_lab(config, PENDULUM, "lab") == []
    shown = run_lab(config, PENDULUM, {"n": 2}).to_json()
    assert {"2.000", "–"} == set(shown["readouts"][0]["texts"])
    assert shown["readouts"][0]["final"] == {"text": "–", "value": None}
    assert shown["plots"][0]["refLines"][0]["y"] is None
    assert shown["plots"][0]["traces"][0]["values"][-1] is None
    assert shown["duration"] == 1.0


TRACE = {"label": "t", "expr": "data.time < 0.2 || ctx.n < 2 ? 1 : lib.qpos('none')"}


def test_a_reference_line_that_never_can_be_drawn_is_a_fault() -> None:
    plots = [{"refLines": [0, {"expr": "lib.qpos('none')"}], "traces": [{"label": "q", "expr": "data.qpos[0]"}]}]
    (fault,) = check_lab(lab(plots=plots), PENDULUM, "lab")
    assert fault.key == "lab.plots.0.refLines.1.expr"


@pytest.mark.parametrize(
    ("keys", "seconds"),
    [
        ({}, 3),
        ({"readouts": [{"label": "q", "expr": "data.qpos[0]"}]}, 10),
        ({"controls": [slider(param="x")]}, 10),
        ({"plots": [{"traces": [{"label": "q", "expr": "data.qpos[0]"}]}]}, 5),
        ({"plots": [{"window": 7, "traces": [{"label": "q", "expr": "data.qpos[0]"}]}]}, 7),
        ({"stopAt": 0.5}, 0.5),
        ({"stopAt": 0.5, "seconds": 2}, 2),
    ],
)
def test_a_run_is_as_long_as_its_author_says_or_as_what_it_shows_needs(keys: dict[str, Any], seconds: float) -> None:
    assert run_lab(lab(**keys), PENDULUM).to_json()["seconds"] == seconds
    assert run_lab(lab(**keys), PENDULUM, seconds=0.25).to_json()["seconds"] == 0.25


def test_what_mujoco_derives_follows_a_button_at_once() -> None:
    config = lab(
        controls=[{"type": "button", "label": "up", "run": "data.qpos[0] = Math.PI"}],
        readouts=[{"label": "z", "expr": "lib.sitePos('tip')[2]"}],
    )
    run = run_lab(config, PENDULUM, events=[(0.0, "up")], seconds=0.1)
    assert run.readouts[0][0] == pytest.approx(1.5)


def test_contact_forces_are_recorded_in_the_world_and_carry_the_weight() -> None:
    ball = """<mujoco><worldbody><geom type="plane" size="1 1 1" euler="0 20 0"/><body pos="0 0 0.1"><freejoint/>
      <geom size="0.1" mass="2" condim="6" friction="1 0.1 0.1"/></body></worldbody></mujoco>"""
    shown = run_lab(lab(overlays={"forces": True}, toggles=["com"], seconds=0.5), ball).to_json()
    assert set(shown["overlays"]) == {"contacts", "com"}
    assert len(shown["overlays"]["contacts"]) == len(shown["overlays"]["com"]) == len(shown["times"])
    (last,) = shown["overlays"]["contacts"][-1]
    normal = [math.sin(math.radians(20)), 0, math.cos(math.radians(20))]
    along = sum(a * b for a, b in zip(last[3:], normal, strict=True))
    assert along == pytest.approx(2 * 9.81 * math.cos(math.radians(20)), rel=0.02)
    assert math.hypot(*last[3:]) > along


def test_every_fault_of_a_lab_is_told_at_once() -> None:
    config = lab(setup="x", controller="y", readouts=[{"label": "r", "expr": "z"}])
    assert len(check_lab(config, PENDULUM, "q.sim")) == 3


def test_a_model_that_does_not_compile_is_a_fault() -> None:
    assert "does not compile" in check_lab(lab(), "<mujoco><bad/></mujoco>", "q.sim")[0].why


def test_a_failure_in_the_middle_of_a_run_names_its_place() -> None:
    config = lab(
        controls=[slider("k", param="k", value=0)], controller="if (ctx.k > 4 && data.time > 1) data.qpos[7] = 1"
    )
    with pytest.raises(LabError, match=r"controller: line 1, column \d+: index 7 is outside data.qpos"):
        run_lab(config, PENDULUM, {"k": 5})


def test_a_predict_question_of_the_course_reads_its_lab() -> None:
    raw = json.loads((ROOT / "quizzes/1.3-check.json").read_text())["questions"][2]
    question = PredictQuestion.model_validate({"id": "q3", **raw})
    assert question.sim is not None
    assert question.sim.model == "pendulum_servo"
