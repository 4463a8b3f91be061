"""Where a script that ran out of time spent it: told from samples, which are a claim."""

import json
import signal
import sys
import time
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.domain.run import Job, Limits, RunStatus, ignore
from grader.sandbox.inside.sampling import Sampler
from grader.sandbox.jail import Jail
from grader.sandbox.spent import explain_time_out
from sandbox.test_frames import encode

STEPS = """import mujoco

def simulate(model, data):
    while data.time < 3:
        mujoco.mj_step(model, data)
        data.time = 0

def main():
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    for h in (0.001, 0.002):
        simulate(model, mujoco.MjData(model))
"""
SLEEPS = "import time\ndef main():\n    time.sleep(60)\n"
DRIVER = "def run(student, inputs, submit):\n    student.main()\n"


def test_the_line_and_its_loop_are_told(jail: Jail) -> None:
    report = jail.run(Job(STEPS, DRIVER, {}, Limits(cpu_s=0.5)))
    assert report.status is RunStatus.TIMED_OUT
    begins = "The script used up its CPU time of 0.5 s. It was busy in line 5 of your script "
    loop = "(mujoco.mj_step(model, data)), in the loop that begins in line 4 (while data.time < 3:), in simulate(). It "
    assert report.reason.startswith(begins + loop)
    assert report.reason.endswith(" times a second. Check when that loop ends.")


NEVER_MOVES = """import mujoco

def simulate(model):
    data = mujoco.MjData(model)
    while data.time < 20:
        mujoco.mj_step(model, data)

def main():
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    low, high = 0.001, 0.05
    while high - low > 1e-4:
        if simulate(model):
            low = (low + high) / 2
"""


def test_a_loop_that_never_ends_is_told_and_not_the_one_within_that_ends_each_time(jail: Jail) -> None:
    report = jail.run(Job(NEVER_MOVES, DRIVER, {}, Limits(cpu_s=0.5)))
    assert report.status is RunStatus.TIMED_OUT
    assert "in line 6 of your script (mujoco.mj_step(model, data)), in simulate(). The loop in " in report.reason
    assert "line 11 (while high - low > 1e-4:), in main(), went on, and leads there each time. It" in report.reason
    assert report.reason.endswith("Check when that loop ends.")


def test_two_signals_at_once_do_not_end_the_count_of_calls() -> None:
    sampler, model, plain = Sampler(__file__, ignore), mujoco.MjModel.from_xml_string("<mujoco/>"), mujoco.mj_step
    data, sampler.count_s_min = mujoco.MjData(model), 0.1
    for _ in range(2):
        sampler.sample(signal.SIGPROF, sys._getframe())
    assert (sampler.rates, sampler.lines.total()) == ({}, 2)
    begin = time.process_time()
    while time.process_time() < begin + sampler.count_s_min:
        mujoco.mj_step(model, data)
    sampler.sample(signal.SIGPROF, sys._getframe())
    assert sampler.rates["mj_step"] > 0
    assert mujoco.mj_step is plain


def test_of_two_loops_in_one_function_neither_is_blamed(jail: Jail) -> None:
    inlined = "def main():\n    while True:\n        for i in range(1000):\n            i * i\n"
    report = jail.run(Job(inlined, DRIVER, {}, Limits(cpu_s=0.5)))
    assert "in the loops that begin in lines 2 and 3, in main(). Check when each of them ends." in report.reason


ALTERNATES = """import mujoco

def is_stable(model, data):
    for _ in range(500):
        mujoco.mj_step(model, data)
        if data.warning[5].number:
            return False
        if data.time > 1e9:
            return False
        x = [i for i in range(30)]
    return True

def main():
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    low, high = 0.001, 0.05
    while low != high:
        is_stable(model, mujoco.MjData(model))
"""


def test_where_no_line_stands_out_the_loop_is_told_and_the_one_that_never_ends(jail: Jail) -> None:
    report = jail.run(Job(ALTERNATES, DRIVER, {}, Limits(cpu_s=0.6)))
    assert report.status is RunStatus.TIMED_OUT
    assert "The loop in line 16 (while low != high:), in main(), went on" in report.reason


CALLED_OFTEN = """def one():
    for i in range(100):
        i * i

def step():
    for _ in range(500):
        one()

def main():
    while True:
        step()
"""


def test_a_loop_that_ends_each_time_is_not_said_to_go_on() -> None:
    lines = {"lines": [[3, 9]], "samples": 10, "rates": {}, "stays": None, "outer": [[7, 10]]}
    results = encode({"where0": np.frombuffer(json.dumps(lines).encode(), np.uint8)})[:-4]
    sentence = explain_time_out(results, CALLED_OFTEN, waits=False, hidden=False)
    assert "The loop in line 6 (for _ in range(500):), in step(), leads there each time." in sentence
    assert "went on" not in sentence


def test_where_no_loop_stands_out_the_one_that_calls_it_all_is_told() -> None:
    spread = {"lines": [[13, 3], [14, 3], [15, 3]], "samples": 10, "rates": {}, "stays": None, "outer": [[7, 10]]}
    results = encode({"where0": np.frombuffer(json.dumps(spread).encode(), np.uint8)})[:-4]
    sentence = explain_time_out(results, CALLED_OFTEN, waits=False, hidden=False)
    assert sentence.startswith(" It was busy in what the loop in line 6 (for _ in range(500):), in step(), calls.")


def test_where_no_loop_stands_out_the_one_that_lasts_is_told() -> None:
    lines = {"lines": [[11, 4], [4, 3], [9, 3]], "samples": 10, "rates": {}, "stays": 11}
    results = encode({"where0": np.frombuffer(json.dumps(lines).encode(), np.uint8)})[:-4]
    sentence = explain_time_out(results, STEPS, waits=False, hidden=False)
    lasts = "went on. Check when it should end."
    assert sentence == f" The loop in line 10 (for h in (0.001, 0.002):), in main(), {lasts}"
    assert explain_time_out(results, STEPS, waits=False, hidden=True) == ""


def test_what_a_script_waits_for_is_told(jail: Jail) -> None:
    report = jail.run(Job(SLEEPS, DRIVER, {}, Limits(wall_s=1)))
    assert report.status is RunStatus.TIMED_OUT
    assert report.reason.endswith("It waited in line 3 of your script (time.sleep(60)), in main(): remove that.")


def sample(
    line: Any = 5, times: Any = 9, samples: Any = 10, rates: Any = None, stays: Any = None, name: str = "where0"
) -> bytes:
    told = {"lines": [[line, times]], "samples": samples, "rates": {"mj_step": 5.2e5} if rates is None else rates}
    told["stays"] = stays
    return encode({name: np.frombuffer(json.dumps(told).encode(), np.uint8)})[:-4]


def told(results: bytes, *, waits: bool = False, hidden: bool = False) -> str:
    return explain_time_out(results, STEPS, waits=waits, hidden=hidden)


def test_with_hidden_inputs_no_number_but_the_line_is_told() -> None:
    assert "520,000" in told(sample())
    assert [char for char in told(sample(), hidden=True) if char.isdigit()] == ["5", "4", "3"]
    assert told(sample(), hidden=True) == told(sample(rates={"mj_step": 7e7}, times=8), hidden=True)


def test_with_hidden_inputs_no_second_line_and_none_beyond_the_last_of_exceptions_is_told() -> None:
    loops = "def a():\n" + "    while b(): pass\n" * 3 + "def b():\n    while True:\n        pass\n"
    said = {explain_time_out(sample(line=7, stays=at), loops, waits=False, hidden=True) for at in (2, 3, 4, None)}
    assert len(said) == 1
    assert explain_time_out(sample(line=7, stays=2), loops, waits=False, hidden=False) not in said
    long = "x = 1\n" * 10_001
    told_at = [bool(explain_time_out(sample(line=at), long, waits=False, hidden=True)) for at in (10_000, 10_001)]
    assert told_at == [True, False]


def test_the_last_sample_counts_and_one_that_was_cut_short_does_not() -> None:
    assert "in line 11 " in told(sample(5) + sample(11, name="where1"))
    assert "in line 5 " in told(sample(5) + sample(11, name="where1")[:-3])


@pytest.mark.parametrize("line", [0, 12, -1, 2.0, True, None, "5", [5]])
def test_a_line_that_is_none_of_the_script_is_not_told(line: Any) -> None:
    assert told(sample(line)) == ""


def test_nothing_is_told_where_no_line_stands_out() -> None:
    assert told(sample(times=4)) == ""
    assert told(b"") == ""


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.sampled_from(["lines", "samples", "rates"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["mj_step", "x"]), inner, max_size=2),
)


@given(
    st.builds(sample, JSON, JSON, JSON, JSON, JSON | st.integers(0, 12)) | st.binary(max_size=80),
    st.booleans(),
    st.booleans(),
)
def test_forged_samples_never_raise(results: bytes, waits: bool, hidden: bool) -> None:
    assert isinstance(told(results, waits=waits, hidden=hidden), str)
