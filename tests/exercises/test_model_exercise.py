"""Exercises of the kind `model`: hostile models, what the jail is told, mistakes, and the pictures of both models. The
reference programs of lesson 4.1 have the mistakes one by one (`grader check`)."""

import json
import re
import time
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import pytest

from grader.courses.rules.policy import limit_feedback
from grader.domain.run import Job, RunReport
from grader.domain.verdict import Status, Verdict
from grader.errors import ContentError
from grader.exercises import plan_exercise
from grader.exercises.kinds.model.measuring import find_braces, list_of_water
from grader.exercises.kinds.model.variants import list_variants
from grader.exercises.kinds.model.xml_faults import explain_xml
from grader.grading.pipeline import Pipeline
from grader.library import Library, load
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail
from grader.web.verdict.evidence import Geom
from grader.web.verdict.plots import draw_figures
from grader.web.verdict.scene_plot import draw_outlines
from support.content import load_content

pytestmark = pytest.mark.jail

ROOT = Path(__file__).parents[2]
QUIZ = "4.1-exercises"
REFERENCE = (ROOT / "quizzes/solutions/arm.xml").read_text()


@pytest.fixture(scope="module")
def library() -> Library:
    return load_content(QUIZ)


@pytest.fixture(scope="module")
def pipeline(library: Library) -> Iterator[Pipeline]:
    with Jail(ROOT / "models", workers=1) as jail:
        yield Pipeline(library, jail.run)


def grade(pipeline: Pipeline, source: str, question: str = "arm") -> Verdict:
    return pipeline.judge(pipeline.read(QUIZ, question, {"source": source}, seed=1))


def put_in(body: str, head: str = "") -> str:
    """A model with this in its world."""
    return f"<mujoco>{head}<worldbody>{body}</worldbody></mujoco>"


BALLS = "<body pos='0 0 {at}'><freejoint/><geom size='.1'/></body>"
HOSTILE = {
    "memory of the arena": put_in("", "<size memory='100G'/>"),
    "a field of a thousand million points": put_in(
        "<geom type='hfield' hfield='h'/>",
        "<asset><hfield name='h' nrow='40000' ncol='40000' size='1 1 1 1'/></asset>",
    ),
    "a million bodies": put_in(
        "<replicate count='1000' offset='1 0 0'><replicate count='1000' offset='0 1 0'>"
        "<body><freejoint/><geom size='.1'/></body></replicate></replicate>"
    ),
    "a heap of contacts": put_in("".join(BALLS.format(at=at / 1000) for at in range(600)))
    .replace("<mujoco>", "<mujoco><size memory='400M'/>"),
    "a deep tree": put_in("<body>" * 15_000 + "</body>" * 15_000),
    "a slow simulation": put_in(
        "<body name='upper'><joint name='shoulder'/><geom size='.1'/><body name='fore'><joint name='elbow'/>"
        "<geom size='.1'/></body></body><replicate count='2000'><body><freejoint/>"
        "<geom size='.1' contype='0' conaffinity='0'/></body></replicate>",
        "<option integrator='RK4' wind='1 0 0' density='1000'/><size memory='50M'/>",
    ),
    "a million geoms": put_in(
        "<replicate count='1000' offset='1 0 0'><replicate count='1000' offset='0 1 0'><geom size='.1'/></replicate>"
        "</replicate>"
    ),
    "a cloth of a million points": put_in(
        "<flexcomp type='grid' count='1000 1000 1' spacing='.1 .1 .1' name='cloth' dim='2' mass='1'/>"
    ),
    "a sphere that is divided fourteen times": put_in(
        "<geom type='mesh' mesh='m'/>", "<asset><mesh name='m' builtin='sphere' params='14'/></asset>"
    ),
    "an entity": "<!DOCTYPE x [<!ENTITY a 'aaaaaaaa'><!ENTITY b '&a;&a;&a;&a;'>]><mujoco model='&b;'/>",
    "not a number": put_in("<body pos='nan 0 0'><geom size='inf'/></body>"),
    "no text": "\0\1\2<mujoco/>",
    "an empty word": "<",
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_model_ends_with_its_verdict(pipeline: Pipeline, name: str) -> None:
    before = time.monotonic()
    verdict = grade(pipeline, HOSTILE[name])
    took_s = time.monotonic() - before
    print(name, verdict.status, verdict.diagnosis, took_s)
    assert verdict.status not in (Status.GRADER_FAULT, Status.CORRECT)
    assert verdict.points == 0
    assert verdict.diagnosis
    assert sum(verdict.timing_ms.get(part, 0) for part in ("script_cpu", "judge_cpu")) < 10_000


FILES = (
    "<include file='/etc/passwd'/>",
    "<asset><mesh name='>' file='/cell/models/any.obj'/></asset>",
    "<![CDATA[<!--]]><include file='pendulum.xml'/><![CDATA[-->]]>",
    "<asset><texture type='2d' FILE = 'x.png'/></asset>",
    "<asset><model name='a' file='models/pendulum.xml'/></asset>",
    "<asset><hfield name='h' file='/etc/passwd' size='1 1 1 1'/></asset>",
    "<extension><plugin plugin='mujoco.sdf.torus'/></extension>",
)


def test_a_model_reads_no_file(pipeline: Pipeline) -> None:
    for text in FILES:
        verdict = grade(pipeline, REFERENCE.replace("<worldbody>", f"{text}<worldbody>"))
        assert verdict.status is Status.INCORRECT
        assert "reads no file" in (verdict.diagnosis or "")
        assert "a comment" not in (verdict.diagnosis or "")
    verdict = grade(pipeline, REFERENCE.replace("<worldbody>", "<!-- file = arm.xml --><worldbody>"))
    assert "Here a comment has such words" in (verdict.diagnosis or "")


SPY = """
import gc, sys

def make_cart(mass, height, gear):
    frame, seen = sys._getframe(), []
    while frame:
        seen.append(repr({**frame.f_globals, **frame.f_locals}))
        frame = frame.f_back
    seen += [one for one in gc.get_objects() if isinstance(one, str)] + [repr(sys.modules["__main__"].__dict__)]
    words = ["aitrenigaid"[::-1], "elop"[::-1]]
    assert not any(all(word in one for word in words) for one in seen), "found it"
    return "<mujoco/>"
"""


def test_the_reference_never_enters_the_process_of_the_script(pipeline: Pipeline, library: Library) -> None:
    assert grade(pipeline, SPY, "cart").status is Status.INCORRECT
    jobs: list[Job] = []

    def note(job: Job) -> RunReport:
        jobs.append(job)
        assert pipeline.run is not None
        return pipeline.run(job)

    Pipeline(library, note).grade(QUIZ, "arm", {"source": "<mujoco/>"})
    assert "capsule" not in json.dumps([jobs[0].inputs, jobs[0].hidden_inputs], default=str)
    assert "capsule" in json.dumps(jobs[1].inputs)
    question = library.question(QUIZ, "arm")
    assert isinstance(question, ScriptQuestion)
    plan = plan_exercise(question, library.model_xml, 1, library.text)
    assert all(trial.inputs == {"arguments": []} for trial in plan.trials)


def test_feedback_says_what_line_and_draws_both_models_as_far_as_the_author_allows(pipeline: Pipeline) -> None:
    wrong = REFERENCE.replace('"elbow" axis="0 1 0"', '"elbow" axis="1 0 0"')
    verdict = grade(pipeline, wrong)
    assert verdict.diagnosis == 'The axis of the joint "elbow" is wrong: it is the x axis of its body.'
    assert verdict.line == 9
    assert verdict.span is None
    assert grade(pipeline, "<mujoco>\n\n<hinge/>\n</mujoco>").line == 3
    titles = {finding.id: finding.title for finding in verdict.findings}
    hidden = next(finding for finding in verdict.findings if finding.id == "hidden-1.1")
    assert (hidden.measured, hidden.expected) == (None, None)
    seen = [limit_feedback(verdict, reveal).evidence for reveal in ("direction", "size", "value")]
    assert ["references" in one for one in seen] == [False, False, True]
    mine, both = (draw_figures(one, titles) for one in seen[1:])
    assert [one.title for one in mine] == ["The parts: the model", "Released at rest: the model"]
    assert [one.title for one in both] == ["The parts: both models", "Released at rest: both models"]
    assert str(both[0].pictures).count('class="geom"') == 2 * str(mine[0].pictures).count('class="geom"') == 12
    assert ("asked for", "0", "capsule", "0.03 0.2 0", "0 0 0.8") in both[0].table


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<mujoco><worldbody></mujoco>", "Line 1: <worldbody> is not closed."),
        ("<mujoco>\n<worldbody>\n<body></worldbody></mujoco>", "Line 3: <body> is not closed."),
        ("<mujoco>\n<body a=1/></mujoco>", "Line 2: an attribute of <body> cannot be read: write each once, as name="),
        ("hello", "Line 1: the text does not end in an element: a model is <mujoco> ... </mujoco>."),
        ("<mujoco>\n<!-- x</mujoco>", "Line 2: a comment is not closed by -->."),
        ("<mujoco><a></a", "Line 1: <a> is not complete"),
        ("<mujoco><![CDATA[ x</mujoco>", "Line 1: a <![CDATA[ is not closed by ]]>."),
        ("<?xml version='1.0'<mujoco/>", "Line 1: the declaration <?xml ...?> is not closed by ?>."),
    ],
)
def test_a_text_that_is_no_xml_is_told_so_in_plain_words(text: str, said: str) -> None:
    with pytest.raises(ValueError, match="XML parse error") as error:
        mujoco.MjSpec.from_string(text)
    assert explain_xml(" ".join(str(error.value).split())).startswith(said)


PLACED = "<mujoco><worldbody><body pos='0 0 {}'/></worldbody></mujoco>"


@pytest.mark.parametrize("braces", ["{height}", "{height / 2:.3f}", "{}"])
def test_braces_that_nothing_has_filled_are_shown(braces: str) -> None:
    text = PLACED.replace("{}", braces)
    with pytest.raises(ValueError, match="bad format") as error:
        mujoco.MjModel.from_xml_string(text)
    assert find_braces(text, str(error.value)) == f"pos of <body> has {braces} in place of a number"
    assert not find_braces(PLACED.replace("{}", "up"), str(error.value))


@pytest.mark.parametrize("kind", ["sphere", "capsule", "cylinder", "box", "ellipsoid"])
def test_a_body_weighs_as_much_as_its_geoms_of_the_default_density(kind: str) -> None:
    geom = f"<geom type='{kind}' size='.1 .2 .3'/><geom type='box' size='.1 .1 .1'/>"
    bodies = (
        f"<body name='a'>{geom}</body><body name='b'>{geom}<inertial mass='1' pos='0 0 0' diaginertia='1 1 1'/></body>"
    )
    assert list_of_water(mujoco.MjModel.from_xml_string(put_in(bodies))) == ["a"]


@pytest.mark.parametrize(
    ("made", "said"),
    [
        ("None", "The function returns nothing: return MJCF text, or a mujoco.MjSpec."),
        ("mass", "The function returns a float: return MJCF text, or a mujoco.MjSpec."),
        ("type(f'x{mass}', (), {})()", "The function returns something else: return MJCF text, or a mujoco.MjSpec."),
        ("'models/cart.xml'", "What is handed over looks like the name of a file: hand over the MJCF itself, <mujoco>"),
    ],
)
def test_what_is_no_model_is_told_what_to_return(pipeline: Pipeline, made: str, said: str) -> None:
    verdict = grade(pipeline, f"def make_cart(mass, height, gear):\n    return {made}\n", "cart")
    assert verdict.status is Status.INCORRECT
    assert (verdict.diagnosis or "").startswith(said), verdict.diagnosis


def test_other_messages_of_mujoco_stay() -> None:
    assert explain_xml("Schema violation: Element 'geom', line 3") == "Schema violation: Element 'geom', line 3"
    unknown = "XML parse error 99: Error=XML_NEW ErrorID=99 (0x63) Line number=7"
    assert explain_xml(unknown) == "Line 7: this is not XML (XML_NEW)."


def test_a_text_that_is_no_xml_is_explained_once_at_its_line(pipeline: Pipeline) -> None:
    verdict = grade(pipeline, "<mujoco>\n<worldbody>\n</mujoco>")
    assert (verdict.diagnosis, verdict.line) == ("Line 2: <worldbody> is not closed.", 2)
    assert not any("worldbody" in finding.message for finding in verdict.findings)


def test_the_line_of_what_a_program_makes_is_no_line_of_the_program(pipeline: Pipeline) -> None:
    verdict = grade(pipeline, "def make_cart(*numbers):\n    return '<mujoco><worldbody></mujoco>'\n", "cart")
    assert verdict.diagnosis == "MuJoCo cannot compile the model: Line 1: <worldbody> is not closed."
    assert verdict.line is None


def test_what_a_model_lacks_is_said_before_the_numbers_that_follow_from_it(pipeline: Pipeline) -> None:
    verdict = grade(pipeline, "<mujoco><worldbody><body name='upper'><geom size='.1'/></body></worldbody></mujoco>")
    said = verdict.diagnosis or ""
    assert said.startswith("the parts: The model has no body 'fore'."), said


def test_outlines_are_those_of_the_geoms() -> None:
    turned = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    for kind, size, width, height in (
        ("sphere", (0.5, 0.0, 0.0), 1.0, 1.0), ("ellipsoid", (0.5, 0.5, 0.5), 1.0, 1.0),
        ("capsule", (0.5, 1.0, 0.0), 1.0, 2 * 0.965926 + 1), ("plane", (1.0, 1.0, 1.0), None, None),
        ("cylinder", (0.5, 1.0, 0.0), 1.0, 2 * 0.965926 + 0.258819),
        ("box", (0.5, 0.5, 1.0), 0.939693 + 0.34202, 2 * 0.965926 + 0.258819 * (0.939693 + 0.34202)),
    ):  # fmt: skip
        outlines = list(draw_outlines([Geom(type=kind, size=size, at=(0, 0, 0), turned=turned)]))
        if width is None or height is None:
            assert not outlines
            continue
        xs, ys = zip(*outlines[0], strict=True)
        assert max(xs) - min(xs) == pytest.approx(width, rel=0.02)
        assert max(ys) - min(ys) == pytest.approx(height, rel=0.02)


def test_every_variant_is_another_model_with_a_sentence() -> None:
    variants = list(list_variants(REFERENCE))
    assert len(variants) > 100
    compiled = 0
    for variant in variants:
        assert ET.canonicalize(variant.xml) != ET.canonicalize(REFERENCE)
        assert re.fullmatch(r"[A-Z][^{}]*[.]", variant.sentence), variant.sentence
        try:
            mujoco.MjModel.from_xml_string(variant.xml)
            compiled += 1
        except ValueError:
            continue
    assert compiled > 0.9 * len(variants)


@pytest.mark.parametrize(
    ("changed", "key", "why"),
    [
        ({"reference": "quizzes/solutions/none.xml"}, "check", "none.xml"),
        ({"reference": "quizzes/starters/cart.py"}, "check.reference", "cannot be compiled"),
        ({"goals": [{"same": ["model.body("]}]}, "check.cases.0.goals.0", "no Python expression"),
        ({"goals": [{"same": ["open('/etc/passwd')"]}]}, "check.cases.0.goals.0", "names open"),
        ({"goals": [{}]}, "check.cases.0.goals.0", '"same" or "within"'),
        ({"start": {"knee": 1}}, "check.cases.0", "the joint 'knee', which the reference lacks"),
        ({"goals": [{"same": ["model.body('arm').mass"]}]}, "check.cases.0.goals.0.same", "the reference has no 'arm'"),
        ({"goals": [{"same": ["model.nope"]}]}, "check.cases.0.goals.0.same", "raises AttributeError"),
        ({"goals": [{"same": ["fullinertia('arm')"]}]}, "check.cases.0.goals.0.same", "the reference has no 'arm'"),
        ({"goals": [{"same": ["model.body('hand').inertia"]}]}, "check.cases.0.goals.0", "Write fullinertia("),
        ({"seconds": 60, "goals": [{"same": ["data.time"]}]}, "check.cases.0", "more than 20000 steps"),
    ],
)
def test_wrong_parameters_are_faults(tmp_path: Path, changed: dict[str, Any], key: str, why: str) -> None:
    write_changed(tmp_path, changed)
    with pytest.raises(ContentError) as refused:
        load(tmp_path)
    faults = {fault.key: fault.why for fault in refused.value.faults}
    assert [one for one, said in faults.items() if one.startswith(f"arm.{key}") and why in said], faults


def write_changed(tmp_path: Path, changed: dict[str, Any]) -> None:
    """Writes a content folder with the exercise `arm`, whose first case is changed, or its reference."""
    raw = json.loads((ROOT / f"quizzes/{QUIZ}.json").read_text())
    question = raw["questions"][0]
    question["check"].update({name: value for name, value in changed.items() if name == "reference"})
    question["check"]["cases"] = question["check"]["cases"][:1]
    question["check"]["cases"][0].update({name: value for name, value in changed.items() if name != "reference"})
    raw["questions"] = [question]
    for path in ("quizzes/solutions/arm.xml", "quizzes/starters/arm.xml", "quizzes/starters/cart.py"):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text((ROOT / path).read_text())
    (tmp_path / "models").mkdir()
    (tmp_path / f"quizzes/{QUIZ}.json").write_text(json.dumps(raw))
