"""The limits of a run, which hold whatever a kind of lab does, and what it returns as JSON."""

import json
import time
from collections.abc import Callable, Mapping
from typing import Any, Literal

import mujoco
import numpy as np
import pytest

from grader.errors import GraderError, LabRefused
from grader.labs import Bench, Lab, LabExample, LabKind, LabRequest, LabSettings, Limits
from grader.labs.kind import write_json

FALLING = "<mujoco><worldbody><body><freejoint/><geom size='0.1'/></body></worldbody></mujoco>"
LOOSE = "<mujoco><worldbody><body><joint type='slide'/><geom size='0.1' mass='1e-9'/></body></worldbody></mujoco>"

LIMITS = Limits()


def bench(limits: Limits = LIMITS, xml: str = FALLING) -> Bench:
    return Bench(lambda name: xml, limits)


def test_steps_are_taken_and_counted() -> None:
    made = bench()
    model = made.load("falling")
    data = mujoco.MjData(model)
    assert made.step(model, data, 2500) == ()
    assert (made.steps, data.time) == (2500, pytest.approx(2500 * model.opt.timestep))


def test_a_loaded_model_is_a_copy_of_its_own() -> None:
    made = bench()
    made.load("falling").opt.timestep = 7.0
    assert made.load("falling").opt.timestep == 0.002


def test_too_many_steps_are_refused_before_they_are_taken() -> None:
    made = bench(Limits(steps=100))
    model = made.load("falling")
    data = mujoco.MjData(model)
    made.step(model, data, 100)
    with pytest.raises(LabRefused, match="more than 100 steps"):
        made.step(model, data, 10**12)
    assert data.time == pytest.approx(0.2)


def test_a_state_that_is_reset_is_told() -> None:
    made = bench(xml=LOOSE)
    model = made.load("loose")
    data = mujoco.MjData(model)
    data.qvel[0] = float("nan")
    assert {one.kind for one in made.step(model, data)} & {"BADQVEL", "BADQPOS"}
    assert made.step(model, data) == ()


def test_a_run_that_takes_too_long_is_ended_at_its_steps_and_where_it_asks() -> None:
    began = time.thread_time()  # before the bench: to load the model is part of its time
    made = bench(Limits(steps=10**9, cpu_s=0.2))
    model = made.load("falling")
    with pytest.raises(LabRefused, match=r"more than 0\.2 s of computing"):
        made.step(model, mujoco.MjData(model), 10**9)
    assert 0.2 <= time.thread_time() - began < 5
    with pytest.raises(LabRefused, match=r"more than 0\.2 s of computing"):
        made.check_time()
    bench(Limits(cpu_s=0.2)).check_time()


def spin(made: Bench) -> None:
    while True:
        made.check_time()


def test_numpy_and_what_is_not_finite_are_written() -> None:
    value = {"a": np.array([1.0, np.nan, np.inf]), "b": np.int64(3), "c": (True, None, "x"), "d": float("-inf")}
    assert json.loads(write_json(value)) == {"a": [1.0, None, None], "b": 3, "c": [True, None, "x"], "d": None}
    assert write_json({"a": [1.5]}) == b'{"a":[1.5]}'


@pytest.mark.parametrize("value", [object(), {"a": {1, 2}}, {"a": b"x"}, {(1, 2): 3}])
def test_what_json_does_not_have_is_named(value: Any) -> None:
    with pytest.raises(GraderError, match="cannot be written as JSON"):
        write_json(value)


def test_a_value_within_itself_is_refused() -> None:
    value: list[Any] = []
    value.append(value)
    with pytest.raises(GraderError, match="cannot be written as JSON"):
        write_json(value)


class Bare(Lab):
    """No keys of its own."""

    kind: Literal["bare"]


class Careless(LabKind[Bare, LabSettings]):
    """A kind that does not look at what it computes."""

    lab, settings = Bare, LabSettings
    limits = Limits(cpu_s=0.2, answer_bytes=1000)

    def __init__(self, work: Callable[[Bench], Any]) -> None:
        self.work = work

    def run(self, lab: Bare, settings: LabSettings, bench: Bench) -> Mapping[str, Any]:
        """Does what the test says."""
        return {"made": self.work(bench)}

    def example(self) -> LabExample:
        """Returns nothing of use."""
        return LabExample({"kind": "bare"}, [], [])


LAB = Bare(id="x", kind="bare")


def xml_of(name: str) -> str:
    return FALLING


@pytest.mark.parametrize(
    ("work", "why"),
    [
        (lambda made: 1 / 0, "its kind fails: ZeroDivisionError: division by zero"),
        (lambda made: "x" * 2000, "The answer of this run is larger than 0.000953674 MB"),
        (lambda made: {1}, "its kind fails: GraderError: what a kind of lab returned cannot be written as JSON"),
        (spin, "This run takes more than 0.2 s of computing"),
    ],
)
def test_an_author_is_told_what_goes_wrong_in_a_kind(work: Callable[[Bench], Any], why: str) -> None:
    (fault,) = Careless(work).check(LAB, "x", xml_of)
    assert fault.key == "x"
    assert fault.why.startswith(why)


def test_a_setting_is_refused_before_the_run() -> None:
    kind = Careless(lambda made: 1 / 0)
    for controls in ({"a": 1.0}, {"a": float("nan")}, {"a": float("inf")}):
        with pytest.raises(LabRefused):
            kind.answer(LAB, LabRequest(controls), xml_of)


def test_a_page_that_could_not_be_drawn_is_refused_when_content_is_loaded() -> None:
    class Unseen(Careless):
        """What its page needs cannot be had."""

        def skeleton(self, lab: Bare) -> dict[str, Any]:
            """Fails."""
            return {"height": lab.model_extra["height"]}  # type: ignore[index]

    (fault,) = Unseen(lambda made: 1).check(LAB, "x", xml_of)
    assert fault.why.startswith("its kind fails: TypeError")
    assert Careless(lambda made: 1).check(LAB, "x", xml_of) == []
