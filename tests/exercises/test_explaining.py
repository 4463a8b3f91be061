"""What a script's text shows: its loops, what it writes and returns, and in which lines."""

import pytest

from grader.exercises.explaining.claims import Evidence, build_claims, correct_sentence
from grader.exercises.explaining.places import find_landmark
from grader.exercises.explaining.script import NO_SCRIPT, ParsedScript
from grader.exercises.explaining.values import find_origin, find_view
from grader.exercises.kinds.rk4.script_facts import LANDMARKS as OF_STEPS
from grader.exercises.kinds.threshold.script_facts import LANDMARKS as OF_SEARCHES
from grader.exercises.kinds.threshold.script_facts import describe_test

SEARCH = """import mujoco


def is_stable(model, h):
    data = mujoco.MjData(model)
    model.opt.timestep = h
    data.qpos[0] = 0.5
    for _ in range(100):
        mujoco.mj_step(model, data)
    return data.warning[4].number == 0


def largest(model, integrator):
    model.opt.timestep = 0.002
    low, high = 0.001, 0.05
    while high - low > 0.0005:
        mid = (high - low) / 2
        if is_stable(model, mid):
            low = mid
        else:
            high = mid
    print(low)
    return 1000 * low, high
"""


@pytest.mark.parametrize(
    ("sentence", "line"),
    [
        ("Your middle is half the difference of the two ends", 17),
        ("After an unstable run your search goes on upwards, so", 18),
        ("Every run used a timestep of 2 ms: the model", 14),
        ("Your runs start with hinge at 0.5 rad, not at 1 rad", 7),
        ("Your function prints its result and returns None.", 22),
        ("You reported milliseconds, not seconds: divide by 1000.", 23),
        ("Your runs are too short: 0.2 s", 8),
        ("Your brackets hold the limit but are too wide: go on halving", 16),
        ("At 50 ms MuJoCo raised BADQACC, and your answer calls that timestep stable.", 10),
        ("Something else", None),
    ],
)
def test_a_sentence_on_a_search_points_at_its_line(sentence: str, line: int | None) -> None:
    assert find_landmark(sentence, ParsedScript(SEARCH), OF_SEARCHES) == line
    assert find_landmark(sentence, NO_SCRIPT, OF_SEARCHES) is None


OWN_TEST = """import mujoco


def is_stable(model, h):
    data = mujoco.MjData(model)
    while data.time < 3:
        mujoco.mj_step(model, data)
        {}
    return {}
"""


@pytest.mark.parametrize(
    ("in_loop", "returned", "line"),
    [
        ("if abs(data.qpos[0]) > 1.2: return False", "True", 8),
        ("if abs(data.qpos[0]) > 1.2: break", "data.time > 3", 8),
        ("if data.warning[4].number: return False", "True", None),
        ("q = data.qpos[0]", "abs(q) < 1", 9),
        ("q = data.qpos[0]", "q", None),
    ],
)
def test_a_criterion_of_ones_own_is_pointed_at_and_no_other_line(in_loop: str, returned: str, line: int | None) -> None:
    source = OWN_TEST.format(in_loop, returned)
    assert find_landmark("raised no warning, and you call it unstable.", ParsedScript(source), OF_SEARCHES) == line


WRITES = """def step(model, data):
    q, v = data.qpos.copy(), data.qvel
    new, rate = q + 1, v + 1
    rate *= 2
    end = new
    for part in (1, 2):
        v = v + part
    data.qpos[:] = end
    data.qvel[:], data.time = rate, 1
    data.act[:] = v
    data.ctrl[:] = q + 1
    return data.qacc
"""


@pytest.mark.parametrize(
    ("line", "field", "origin"),
    [
        (8, "qpos", 3),
        (9, "qvel", 4),
        (9, "time", 9),
        (10, "act", 10),
        (11, "ctrl", 11),
        (8, "qvel", 8),
        (99, "act", 99),
    ],
)
def test_a_written_variable_leads_to_the_line_that_computes_it(line: int, field: str, origin: int) -> None:
    assert find_origin(ParsedScript(WRITES), line, field) == origin
    assert find_origin(NO_SCRIPT, line, field) == line


@pytest.mark.parametrize(("fields", "line"), [(["qvel"], 2), (["qacc", "act_dot"], 12), (["qpos"], None)])
def test_the_line_that_keeps_a_field_without_a_copy_is_found(fields: list[str], line: int | None) -> None:
    assert find_view(ParsedScript(WRITES), fields) == line


def test_the_last_assignment_to_a_field_is_pointed_at() -> None:
    source = "def f(m, d):\n    h = m.opt.timestep\n    m.opt.timestep = h / 2\n    m.opt.timestep /= 2\n    x = h\n"
    sentence = "Your step changes the model that it is given: after the first call model.opt.timestep is 0.25 times"
    assert find_landmark(sentence, ParsedScript(source), OF_STEPS) == 4
    assert ParsedScript("setattr(m.opt, 'timestep', 1)").find_write("timestep") == 1
    assert ParsedScript("m.body_mass[1] = 2").find_write("body_mass") == 1


@pytest.mark.parametrize(
    ("update", "line"),
    [
        ("    low, high = (mid, high) if ok(mid) else (low, mid)\n", 3),
        ("    if ok(mid):\n        low = mid\n    else:\n        high = mid\n", 3),
        ("    if ok(mid): low = mid\n    if not ok(mid): high = mid\n", None),  # two tests
    ],
)
def test_the_test_of_a_bisection_is_found(update: str, line: int | None) -> None:
    source = f"while high - low > w:\n    mid = 0.5 * (low + high)\n{update}"
    assert find_landmark("Your test is the wrong way round", ParsedScript(source), OF_SEARCHES) == line


@pytest.mark.parametrize(
    ("source", "keeps"),
    [
        ("found = []\ndef f(x): found.append(x)\n", True), ("A, B = [], {}\ndef f(x): pass\n", True),
        ("def f(x, found=[]): pass\n", True), ("def f(x):\n    global y\n    y = x\n", True),
        ("def f(x): return f.count\n", True), ("def f(x):\n    found = []\n    return found\n", False),
        ("G = 9.81\ndef f(x): return G * x\n", False),
    ],
)  # fmt: skip
def test_what_lives_on_between_calls_is_seen(source: str, keeps: bool) -> None:
    assert ParsedScript(source).keeps_values_outside is keeps


def test_a_view_is_told_from_a_copy() -> None:
    assert ParsedScript("k = data.qacc").has_view("qacc")
    assert ParsedScript("ks.append(data.qacc)").has_view("qacc")
    assert ParsedScript("q, v = data.qpos[:], 1").has_view("qpos")
    assert not ParsedScript("k = data.qacc.copy()").has_view("qacc")
    assert not ParsedScript("k = np.array(data.qacc)").has_view("qacc")
    assert not ParsedScript("k = 2 * data.qacc").has_view("qacc")


@pytest.mark.parametrize(
    ("test", "said"),
    [
        ("any(w.number > 1 for w in data.warning)", "more than one warning"), ("x.number > 0", ""),
        ("data.warning[4].lastinfo", "lastinfo"), ("np.isnan(data.qpos).any()", "nan or inf"),
        ("data.warning[mujoco.mjtWarning.mjWARN_CONTACTFULL].number", "another kind"),
        ("data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number", ""),
    ],
)  # fmt: skip
def test_what_a_script_looks_for_is_said(test: str, said: str) -> None:
    sentence = describe_test(ParsedScript(f"def f(data):\n    return {test}\n"))
    assert said in sentence
    assert bool(said) is bool(sentence)


def test_no_script_is_too_odd_to_be_read() -> None:
    for source in ("def (", "x = " + "+".join("1" * 5000), "\0", "x = 1\n" * 100_000, "é = [\n"):
        script = ParsedScript(source)
        script.has_loop, script.names, script.returns_in_loops, script.keeps_values_outside  # noqa: B018
        assert find_landmark("Your middle is", script, OF_SEARCHES) is None


def test_weaker_words_stand_in_the_place_of_what_is_not_true() -> None:
    claims = build_claims([(r"your loop (\w+)", lambda evidence, match: evidence.script.has_loop, r"something \1")])
    said = "Mend it: your loop ends early."
    assert correct_sentence(said, Evidence(ParsedScript("x = 1"), (), ()), claims) == "Mend it: something ends early."
    assert correct_sentence(said, Evidence(ParsedScript("for x in y: pass"), (), ()), claims) == said
