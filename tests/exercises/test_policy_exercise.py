"""Policies from files, through the real jail: every reference file gets its status and its diagnosis, nothing is
unpickled, and no hostile file is the grader's fault."""

import base64
import io
import json
import os
import re
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from grader.domain.verdict import Status, Verdict
from grader.exercises import JudgedTrial, plan_exercise
from grader.exercises.episodes.simulating import EpisodeRun
from grader.exercises.film import FRAMES_MAX
from grader.exercises.kinds.policy import variants
from grader.exercises.kinds.policy.judge import RefusedFile, SimulatedPolicy, judge_policy
from grader.exercises.kinds.policy.mistakes import name_the_mistake
from grader.exercises.kinds.policy.network import ACTIVATIONS, Network
from grader.exercises.kinds.policy.parameters import PolicyParameters
from grader.exercises.rehearsing import check_exercise
from grader.grading.pipeline import Pipeline
from grader.grading.references import read_demand
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail
from support.content import load_content
from support.sites import ROOT

pytestmark = [pytest.mark.jail, pytest.mark.slow]

QUIZ = "5.1-exercises"
FILES = sorted((ROOT / "reference_solutions" / QUIZ).glob("*/*.npz"))
SEED = 7


@pytest.fixture(scope="module")
def pipeline() -> Iterator[Pipeline]:
    library = load_content(QUIZ)
    with Jail(library.root / "models", workers=2) as jail:
        yield Pipeline(library, jail.run)


def pack(arrays: Mapping[str, Any]) -> bytes:
    """A file as numpy.savez writes it."""
    written = io.BytesIO()
    np.savez(written, **arrays)
    return written.getvalue()


def grade(pipeline: Pipeline, question: str, data: bytes, seed: int = SEED) -> Verdict:
    return pipeline.grade(QUIZ, question, {"file": base64.b64encode(data).decode()}, seed)


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_a_file_is_judged_and_named_as_expected(path: Path, pipeline: Pipeline) -> None:
    beside = path.with_suffix(".txt")
    status, diagnosis = read_demand(beside.read_text() if beside.exists() else "", path.stem.partition("__")[0])
    verdict = grade(pipeline, path.parent.name, path.read_bytes())
    assert verdict.status == status, verdict.diagnosis
    assert (diagnosis or "") in (verdict.diagnosis or "")
    assert verdict.line is None


def test_there_are_enough_of_them() -> None:
    statuses = Counter(path.stem.partition("__")[0] for path in FILES)
    assert set(statuses) <= set(Status)
    assert statuses["correct"] >= 8
    assert statuses.total() - statuses["correct"] >= 25


def find_question(pipeline: Pipeline, name: str) -> ScriptQuestion:
    question = pipeline.library.question(QUIZ, name)
    assert isinstance(question, ScriptQuestion)
    return question


GAINS = np.array([[13.0], [68.0], [12.6], [15.6]])


def test_the_share_has_its_interval_and_nothing_hidden_is_told(pipeline: Pipeline) -> None:
    verdict = grade(pipeline, "cart-pole-policy", pack({"W1": GAINS}))
    assert verdict.status is Status.CORRECT
    (some,) = [finding for finding in verdict.findings if finding.id == "some"]
    assert some.message.endswith("10 of 10 episodes reach every goal (95 % interval: 72 to 100 %); 90 % must.")
    (hidden,) = [finding for finding in verdict.findings if finding.id == "hidden-1"]
    assert (hidden.message, hidden.measured) == ("Enough episodes reach every goal.", None)
    assert {chart["case"] for chart in verdict.evidence["motions"]} == {"lean", "some"}
    lean, some = verdict.evidence["film"]["cases"]
    assert [lean["case"], some["case"]] == ["lean", "some"]
    assert len(lean["runs"][0]["qpos"]) == FRAMES_MAX
    plan = plan_exercise(find_question(pipeline, "cart-pole-policy"), pipeline.library.model_xml, SEED)
    for trial in plan.trials:
        assert trial.inputs == {
            "arrays": {"W1": [4, 1]},
            "width": 4,
            "functions": ["linear"],
            "observed": ["cart", "pole", "cart_rate", "pole_rate"],
        }
    assert len({episode.xml for trial in plan.trials for episode in trial.problem.episodes}) > 10


def member(name: str, shape: str, data: bytes, descr: str = "'<f4'") -> bytes:
    """A member of an .npz file with a header that may lie."""
    header = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    header += b" " * (63 - (len(header) + 10) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + data


def zipped(*members: tuple[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    written = io.BytesIO()
    with zipfile.ZipFile(written, "w", method) as file:
        for name, data in members:
            file.writestr(name, data)
    return written.getvalue()


class Runs:
    """Creates a file when it is unpickled."""

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str, int]]:
        return os.mknod, ("/tmp/unpickled_policy", 0o600)


def write_hostile() -> Iterator[tuple[bytes, Status, str]]:
    """Yields files that no policy should be, with the status and a part of the sentence that each must get."""
    right = member("W1", "(4, 1)", np.ones(4, "<f4").tobytes())
    bomb = bytes(200_000_000)
    yield zipped(("W1.npy", right + bomb)), Status.INCORRECT, ""  # what follows the array is never unpacked
    yield zipped(("W1.npy", right), ("huge.npy", bomb)), Status.INCORRECT, "an array huge that is not of the declared"
    for shape in ("(50000, 50000)", "(4, 1, 1)", "(-4, 1)", "()", "(4611686018427387904, 4)"):
        yield zipped(("W1.npy", member("W1", shape, bomb[:100]))), Status.INCORRECT, "W1"
    objects = pack({"W1": np.array([[Runs()]] * 4, dtype=object)})
    yield objects, Status.CRASHED, "W1 holds Python objects"
    yield zipped(("W1.npy", member("W1", "(4, 1)", b"", "'|O'"))), Status.CRASHED, "W1 holds Python objects"
    yield zipped(("W1.npy", member("W1", "(4, 1)", b"", "[('a', '|O')]"))), Status.CRASHED, "W1 holds Python objects"
    yield zipped(("W1.npy", member("W1", "(4, 1)", b"", "[('a', '<f8')]"))), Status.INCORRECT, "numpy.float32"
    yield zipped(("W1.npy", member("W1", "(2**62,)", b""))), Status.CRASHED, "no array as numpy.savez writes it"
    yield zipped(("W1.npy", b"\x80\x04\x95")), Status.CRASHED, "no array as numpy.savez writes it"
    yield (
        zipped(("W1.npy", member("W1", "(4, 1)", b"", "(" * 4000))),
        Status.CRASHED,
        "no array as numpy.savez writes it",
    )
    yield zipped(("archive/data.pkl", b"x")), Status.CRASHED, "as torch.save and pickle write it"
    yield zipped(("W1.npy", right[:-3])), Status.CRASHED, "shorter than its header says"
    yield zipped(("W1.npy", right), method=zipfile.ZIP_BZIP2), Status.CRASHED, "no array as numpy.savez writes it"
    yield zipped(("W1.npy", right), method=zipfile.ZIP_LZMA), Status.CRASHED, "no array as numpy.savez writes it"
    yield zipped(), Status.INCORRECT, "The file has no array W1. It needs W1; it has none."
    yield zipped(*((f"{i}\x1b[2J\n.npy", b"") for i in range(1500))), Status.INCORRECT, "it has 0?[2J?, 1?[2J?"
    with pytest.warns(UserWarning, match="Duplicate name"):
        yield zipped(("W1.npy", right), ("W1.npy", right)), Status.CRASHED, "twice"
    whole = zipped(("W1.npy", right))
    broken = whole.replace(zlib.compress(b"")[:1], b"\0")
    yield whole[:50], Status.CRASHED, "The file is damaged"
    yield broken[:40] + b"\xff" * 8 + broken[48:], Status.CRASHED, ""
    yield b"PK\x05\x06" + bytes(18), Status.INCORRECT, "no array W1"
    yield b"PK" + bytes(1000), Status.CRASHED, "The file is damaged"
    for descr, what in (("'<c16'", "complex128"), ("'|b1'", "bool"), ("'<U9'", "str"), ("'<M8[s]'", "datetime64[s]")):
        yield zipped(("W1.npy", member("W1", "(4, 1)", b"", descr))), Status.INCORRECT, f"W1 holds {what}"[:16]
    yield pack({"W1": np.array([[np.inf], [0], [0], [0]])}), Status.INCORRECT, "W1 holds inf"
    yield pack({"W1": GAINS, "mean": np.zeros(4)}), Status.INCORRECT, "both mean and std"
    yield pack({"W1": GAINS, "mean": np.zeros(4), "std": np.full(4, np.nan)}), Status.INCORRECT, "std holds nan"
    yield pack({"W1": np.full((4, 1), 1e308)}), Status.INCORRECT, "overflow"
    yield pack({"W1": GAINS, "mean": np.zeros(4), "std": np.full(4, 5e-324)}), Status.INCORRECT, ""


def test_a_hostile_file_gets_a_clear_sentence_and_runs_nothing(pipeline: Pipeline) -> None:
    for data, status, sentence in write_hostile():
        assert len(data) <= 256 * 1024
        verdict = grade(pipeline, "cart-pole-policy", data)
        assert verdict.status is status, (verdict.status, verdict.diagnosis, sentence)
        assert sentence in (verdict.diagnosis or ""), verdict.diagnosis
        assert (verdict.diagnosis or "x").isprintable()
    assert not Path("/tmp/unpickled_policy").exists()


def test_a_forged_result_is_no_policy(pipeline: Pipeline) -> None:
    plan = plan_exercise(find_question(pipeline, "cart-pole-policy"), pipeline.library.model_xml, SEED)
    trial, parameters = plan.trials[0], plan.parameters
    assert isinstance(parameters, PolicyParameters)
    for forged in (
        {}, {"weights": np.zeros((4, 1))}, {"weights": np.zeros(4, int)}, {"weights": np.full(4, np.nan)},
        {"weights": np.zeros(3)}, {"weights": np.zeros(12)}, {"weights": np.zeros(())}, {"refused": np.zeros(3)},
        {"refused": np.full(9, 7, np.uint8)}, {"refused": np.full(9999, 65, np.uint8)}, {"unreadable": np.zeros(0)},
    ):  # fmt: skip
        judged = judge_policy(parameters, trial, forged)
        assert (judged.passed, type(judged.outcome), judged.message) == (
            False, RefusedFile, "Nothing could be read from the file.",
        )  # fmt: skip


def test_an_untrained_network_is_not_told_a_mistake_that_it_does_not_make(pipeline: Pipeline) -> None:
    """A variant is named where it works, and none works by chance."""
    sentences = [value for name, value in vars(variants).items() if name.isupper() and isinstance(value, str)]
    starts = {sentence.partition("{")[0][:30] for sentence in sentences}
    shapes = {"W1": (3, 32), "b1": (32,), "W2": (32, 32), "b2": (32,), "W3": (32, 1), "b3": (1,)}
    for seed in range(4):
        rng = np.random.default_rng(seed)
        verdict = grade(
            pipeline, "servo-arm-policy", pack({name: rng.normal(0, 0.5, shape) for name, shape in shapes.items()})
        )
        assert verdict.status is Status.INCORRECT
        assert not any((verdict.diagnosis or "").startswith(start) for start in starts), verdict.diagnosis


def test_units_that_are_dead_in_some_episodes_alone_hide_no_transposed_weights() -> None:
    """Of the sled on one side every unit is 0, whose weights work once they are transposed."""
    xml = XML.replace("</sensor>", '<jointvel name="speed" joint="rail"/></sensor>').replace("-2 2", "-20 20")
    question = ask(
        program=None, observe=["place", "speed"], goals=[{"goal": "error", "from_s": 3, "max": 0.02}],
        form={"kind": "mlp", "hidden": [2], "activation": "relu", "actions": "controls"},
        cases=[{"id": "some", "episodes": 8, "share": 1, "start": {"rail": [-0.5, 0.5]}}],
    )  # fmt: skip
    plan = plan_exercise(question, lambda name: xml, SEED)
    (trial,), parameters = plan.trials, plan.parameters
    assert isinstance(parameters, PolicyParameters)

    def diagnose(first: np.ndarray[Any, Any]) -> str | None:
        weights = np.concatenate([part.ravel() for part in (first, np.zeros(2), np.array([1.0, -1.0]), np.zeros(1))])
        judged = judge_policy(parameters, trial, {"weights": weights})
        return None if judged.passed else name_the_mistake(parameters, [JudgedTrial(trial, judged, counts=False)])

    right = np.array([[-40.0, 40.0], [-12.0, 12.0]])
    assert diagnose(right) is None
    assert (diagnose(right.T) or "").startswith("The policy works with W1 transposed")
    assert "dead units" not in (diagnose(np.array([[-40.0, 12.0], [40.0, -12.0]])) or "")
    assert "dead units" in (diagnose(np.zeros((2, 2))) or "")


def test_a_network_computes_what_its_form_says() -> None:
    x = np.linspace(-3, 3, 13)
    written = {
        "tanh": np.tanh(x), "relu": x * (x > 0), "leaky_relu": np.where(x > 0, x, 0.01 * x),
        "elu": np.where(x > 0, x, np.exp(x) - 1), "silu": x / (1 + np.exp(-x)), "softplus": np.log(1 + np.exp(x)),
        "sigmoid": 1 / (1 + np.exp(-x)),
    }  # fmt: skip
    assert written.keys() == ACTIVATIONS.keys()
    for name, function in ACTIVATIONS.items():
        assert np.allclose(function(x), written[name], rtol=1e-13)
    rng = np.random.default_rng(0)
    layers = tuple((rng.normal(size=shape), rng.normal(size=shape[1])) for shape in ((3, 5), (5, 2)))
    limits, norm = (np.array([0.0, -1.0]), np.array([10.0, 3.0])), (rng.normal(size=3), rng.uniform(1, 2, 3))
    network = Network(layers, "silu", "tanh", limits, norm)
    seen = rng.normal(size=3)
    z = (seen - norm[0]) / norm[1] @ layers[0][0] + layers[0][1]
    y = np.tanh(z / (1 + np.exp(-z)) @ layers[1][0] + layers[1][1])
    assert np.allclose(network.act(seen), [5 + 5 * y[0], 1 + 2 * y[1]], rtol=1e-13)


XML = """<mujoco><option timestep="0.01"/><worldbody><body><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<joint name="rail" type="slide" axis="1 0 0"/></body></worldbody>
<actuator><motor joint="rail" ctrllimited="true" ctrlrange="-2 2"/></actuator>
<sensor><jointpos name="place" joint="rail"/></sensor></mujoco>"""

PROGRAM = """
import numpy as np

def reset(model, data, rng):
    data.qpos[0] = rng.uniform(1, 2)

def observe(model, data):
    return np.concatenate((data.qpos, data.qvel))

def reward(model, data, controls):
    return 1.0 - abs(data.qpos[0]) - 0.01 * controls[0] ** 2

def terminated(model, data):
    return abs(data.qpos[0]) > 3
"""

CHECK: dict[str, Any] = {
    "kind": "policy", "model": "sled", "period_s": 0.05, "duration_s": 4, "track": "place",
    "program": "programs/env.py", "form": {"kind": "linear", "bias": False}, "goals": [{"goal": "return", "min": 25}],
    "cases": [{"id": "some", "episodes": 8, "share": 1}],
}  # fmt: skip


def ask(**changes: Any) -> ScriptQuestion:
    check = {name: value for name, value in (CHECK | changes).items() if value is not None}
    return ScriptQuestion.model_validate({"id": "sled", "kind": "code", "q": "?", "takes": "npz", "check": check})


def open_scene() -> Any:
    """The environment that docs/learning.md gives to learners, of the author's program."""
    page = (ROOT / "docs" / "learning.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"```py\n(class .*?)```", page, re.DOTALL)
    names: dict[str, Any] = {"gymnasium": gymnasium, "mujoco": mujoco, "np": np}
    exec(text, names)
    program: dict[str, Any] = {}
    exec(PROGRAM, program)
    return names["Scene"](XML, SimpleNamespace(**program), 5)


@pytest.mark.filterwarnings("ignore:.*A Box observation space:UserWarning")
def test_an_environment_of_the_author_earns_what_gymnasium_says(pipeline: Pipeline) -> None:
    plan = plan_exercise(ask(), lambda name: XML, SEED, lambda path: PROGRAM)
    (trial,), parameters = plan.trials, plan.parameters
    assert isinstance(parameters, PolicyParameters)
    gains = np.array([-1.5, -2.0])
    judged = judge_policy(parameters, trial, {"weights": gains})
    assert judged.passed, judged.detail
    env = open_scene()
    check_env(env, skip_render_check=True)
    for index, record in enumerate(judged.outcome.records[:3]):
        observed, _ = env.reset()
        env.data.qpos[:] = record.observed[0][:1]
        mujoco.mj_forward(env.model, env.data)
        observed, rewards = env.observe(), []
        for _ in range(trial.problem.periods):
            observed, reward, over, _, _ = env.step([np.clip(observed @ gains / 2, -1, 1)])
            rewards.append(reward)
            assert not over
        assert np.allclose(rewards, record.rewards, atol=1e-9)
        again = EpisodeRun(parameters, trial.problem, index).observe().observed
        assert np.array_equal(again, record.observed[0])
    assert len({record.observed[0][0] for record in judged.outcome.records}) == 8

    away = judge_policy(parameters, trial, {"weights": -gains})
    assert isinstance(away.outcome, SimulatedPolicy)
    assert all(record.is_over and len(record.time_s) < trial.problem.periods for record in away.outcome.records)
    assert "ended before its time" in away.message


@pytest.mark.parametrize(
    ("changes", "key", "why"),
    [
        ({"program": None}, "sled.check.observe", "give sensors"),
        ({"observe": ["place"]}, "sled.check.observe", "defines no function observe"),
        ({"observe": ["place", "wrong"], "program": None}, "sled.check.observe.1", "no sensor 'wrong'"),
        ({"track": "plase"}, "sled.check.track", "no sensor 'plase'; it has: place"),
        ({"observe": ["qpos", "qvel"], "program": None}, "sled.check.goals", "`return` needs a `program`"),
        ({"goals": [{"goal": "return", "max": 3}]}, "sled.check.goals.0", '"max" is not for "return"'),
        ({"form": {"kind": "linear", "hidden": [3]}}, "sled.check.form", '"hidden" is for "mlp" alone'),
        ({"form": {"kind": "mlp"}}, "sled.check.form", 'give "hidden"'),
        ({"form": {"kind": "mlp", "hidden": [500, 500]}}, "sled.check.form", "at most 50000 fit into a file"),
        ({"form": {"kind": "mlp", "hidden": [3], "activation": "gelu"}}, "sled.check.form.activation", "tanh"),
        ({"normalisation": {"mean": [0], "std": [1]}}, "sled.check.normalisation", "needs 2 numbers each"),
        ({"cases": [{"id": "a", "episodes": 200}], "duration_s": 100}, "sled.check", "at most 100000"),
        ({"mistakes": [{"program": "a.py", "sentence": "?"}]}, "sled.check.mistakes.0.program", "takes a file"),
    ],
)
def test_what_cannot_work_is_a_fault(changes: dict[str, Any], key: str, why: str) -> None:
    faults = check_exercise(ask(**changes), lambda name: XML, "quiz", lambda path: PROGRAM)
    assert any(fault.key == key and why in fault.why for fault in faults), faults


@pytest.mark.parametrize(
    ("program", "why"),
    [
        ("x = 1", "it must define one of the functions reset, observe, reward, terminated"),
        (PROGRAM.replace("np.concatenate(", "np.nope("), "module 'numpy' has no attribute 'nope'"),
        (PROGRAM.replace("data.qvel))", "data.qvel / 0))"), "not finite"),
        ("def observe(", "line 1"),
        (PROGRAM.replace("rng.uniform", "np.random.uniform"), "the same episode runs otherwise each time: draw from"),
        (PROGRAM.replace("rng.uniform(1, 2)", "np.nan"), "`reset` of the author's program sets a number of data.qpos"),
    ],
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_program_that_cannot_work_is_a_fault(program: str, why: str) -> None:
    faults = check_exercise(ask(), lambda name: XML, "quiz", lambda path: program)
    assert [why in fault.why for fault in faults] == [True], faults


def test_the_exercises_of_the_lesson_are_within_their_bounds() -> None:
    raw = json.loads((ROOT / "quizzes" / f"{QUIZ}.json").read_text())
    assert len(raw["questions"]) >= 3
    assert sum(path.stat().st_size for path in FILES) < 300_000
