"""What students type where the largest timestep is asked for: bounds, products, chains of equations, and remarks."""

import pytest

from grader.errors import InvalidAnswer
from grader.questions.kinds.number import Number, NumberQuestion
from grader.questions.kinds.number.phrases import AskedBound, find_asked_bound
from grader.questions.kinds.number.quantities import read_quantity

QUESTION = NumberQuestion.model_validate(
    {"kind": "numeric", "id": "h", "q": "What is the largest stable timestep (in ms)?", "answer": 5, "unit": "ms"}
)

FIVE = [
    "at most 5 ms", "At most 5ms", "at most 5", "up to 5 ms", "Up to 5 ms", "max 5 ms", "max. 5 ms", "maximum 5 ms",
    "maximum of 5 ms", "max: 5 ms", "maximum: 5 ms", "no more than 5 ms", "not more than 5 ms", "less than 5 ms",
    "below 5 ms", "under 5 ms", "smaller than 5 ms", "< 5 ms", "<5 ms", "<5", "<= 5 ms", "≤ 5 ms", "≤5ms", "=< 5 ms",
    "5 ms or less", "5 ms or lower", "5 ms or below", "5 ms or smaller", "5 ms max", "5 ms max.", "5 ms maximum",
    "5 ms at most", "h at most 5 ms", "h must be at most 5 ms", "h must be less than 5 ms", "h should be below 5 ms",
    "h is less than 5 ms", "the timestep must be below 5 ms", "h has to be smaller than 5 ms", "timestep < 5 ms",
    "dt ≤ 0.005 s", "Δt < 5 ms", "h less than 5 ms", "h max 5 ms", "at most 0.005 s", "up to 0.005 s",
    "at most about 5 ms", "just below 5 ms", "just under 5 ms", "less than or equal to 5 ms",
    "smaller or equal 5 ms", "höchstens 5 ms", "bis zu 5 ms", "maximal 5 ms", "must be < 5 ms", "h < 2I/c = 5 ms",
    "h ≤ 2I/c = 0.005 s", "dt<=5ms", "strictly less than 5 ms", "anything below 5 ms", "h = 2*0.05/20 = 0.005 s",
    "h = 2I/kv = 0.1/20 = 0.005 s = 5 ms", "0.1/20 = 0.005 = 5 ms", "2*0.05/20 = 0.005 s", "2 * 0.05 / 20 = 5 ms",
    "h=2*I/c=2*0.05/20=0.005s", "0.005 = 5 ms", "h = 0.005 = 5 ms", "h < 2I/c = 2*0.05/20 = 0.005 s",
    "h_max = 2 I / c = 5 ms", "0.1/20 s = 5 ms", "h = 0.1 / 20 = 5e-3 s", "5e-3 = 5 ms", "h = 5 ms = 0.005 s",
    "2(0.05)/20 = 5 ms", "h=2I/kv=5ms", "h = 2*0.05/20 = 0.1/20 = 1/200 s = 5 ms", "2*0.05/20 s", "2 * 0.05 / 20 s",
    "2×0.05/20 s", "0.1/20*1000 ms", "0.1/20*1000", "2*0.05/20*1000 ms", "1000*0.1/20", "1000 * 0.1 / 20 ms",
    "1000*0.005", "5*1 ms", "2*2.5 ms", "0.05*2/20 s", "(2*0.05)/20 s", "(0.1)/20 s", "2·0.05/20 s", "0.5*10 ms",
    "10/2 ms", "0.1/20 s", "(0.1/20) s", "100/20 ms", "2*50/20 ms", "1e3*0.1/20 ms", "5 ms or so", "5 or so",
    "5 ms, or so", "5 ms because 2I/c", "5 ms because h < 2I/c", "5 ms since h = 2 I / kv",
    "5 ms because 2*0.05/20 = 0.005", "5 ms (milliseconds)", "5 ms (ms)", "5 (milliseconds)", "5 ms (rounded)",
    "5 ms (approximately)", "0.005 s (seconds)", "5 ms, because of the damper", "5 ms due to explicit damping",
    "0.005 s because h=2I/c", "about 5 ms or so", "5 ms, I think", "5 ms I believe", "5 ms probably",
    "5 ms (I think)", "5 ms for stability", "5 ms weil h < 2I/c", "5ms (=0.005 s)", "5 ms (0.005 s)",
    "0.005 s (5 ms)", "5 ms i.e. 0.005 s", "5 ms, i.e. 0.005 s", "5 ms or 0.005 s", "5~ms", "5 ~ ms",
    "5~\\mathrm{ms}", "h=5~ms", "$5~$ms", "it's 5 ms", "that would be 5 ms", "the answer is 5 ms", "answer is 5ms",
    "my answer: 5 ms", "I'd say 5 ms", "it should be 5 ms", "h would be 5 ms", "so h = 5 ms", "=> 5 ms", "-> 5 ms",
    "→ 5 ms", "result: 5 ms", "5 ms.", "5 ms?",
]  # fmt: skip

REFUSED = [
    "at least 5 ms", "> 5 ms", "≥ 5 ms", "more than 5 ms", "above 5 ms", "over 5 ms", "no less than 5 ms",
    "h > 5 ms", "h >= 5 ms", "5 ms or more", "5 ms or higher", "between 4 and 5 ms", "4 to 5 ms", "4-5 ms",
    "5 ± 1 ms", "not 5 ms", "5 kg", "5 Hz", "0.005 ms = 6 ms", "4 ms or 5 ms", "4 ms = 5 ms", "5x10-3 s", "5*103 us",
    "5/10/2020", "5 ms (kg)", "five", "??", "2*", "*5", "5**", "5 ms because", "5 5 ms", "5,000 us", "2+3 ms",
    "sqrt(25) ms", "log 5", "h", "ms", "5 ms and 6 ms", "at most", "< ", "up to", "5 ms 6 s", "-", "", "max",
    "1/0 s", "5 ms or 5 s", "less than 5 or more than 7 ms", "at most 4 to 5 ms", "not less than 5 ms",
    "not below 5 ms", "5 ms minimum", "at most at least 5 ms", "2*0.05/20 kg", "5*-3 ms*", "10 ms / 2 ms",
    "5 ms (6 ms)", "0.005 = 6 ms",
    "5 ms (wrong)", "5 ms (Euler)", "at most 4 or 5 ms", "not at most 5 ms", "5*10-3 s", "2*103 ms", "1/2/2026",
    "5 ms because", "no more", "no less than 5 ms", "5 ms, no 6 ms", "5/0 ms", "5*(2+3) ms",
]  # fmt: skip
"""Never read: another bound, several numbers, another unit, a date, a power of ten that lost its sign."""


@pytest.mark.parametrize("text", FIVE)
def test_it_is_read_as_five_milliseconds(text: str) -> None:
    assert Number().read(QUESTION, text).value == pytest.approx(5, rel=1e-12)


@pytest.mark.parametrize("text", REFUSED)
def test_it_is_refused(text: str) -> None:
    with pytest.raises(InvalidAnswer):
        Number().read(QUESTION, text)


@pytest.mark.parametrize("text", ["at most 5 ms", "< 5 ms", "up to 5 ms", "5 ms or less", "max 5 ms"])
def test_a_bound_is_an_answer_only_where_it_is_asked_for(text: str) -> None:
    for question in ("", "What is the smallest?", "Between the smallest and the largest?"):
        with pytest.raises(InvalidAnswer):
            read_quantity(text, "ms", question)
    assert read_quantity(text, "ms", "What is the largest?").value == 5


def test_a_lower_bound_is_one_where_the_smallest_is_asked_for() -> None:
    for text in ("at least 5 ms", "> 5 ms", "5 ms or more", "no less than 5 ms"):
        assert read_quantity(text, "ms", "What is the smallest?").value == 5


@pytest.mark.parametrize(
    ("question", "asks"),
    [
        ("What is the largest timestep?", AskedBound.LARGEST), ("Give the minimum damping.", AskedBound.SMALLEST),
        ("How long is the period?", None), ("From the smallest to the largest: how many?", None),
    ],
)  # fmt: skip
def test_the_words_of_a_question_say_which_bound_it_asks_for(question: str, asks: AskedBound | None) -> None:
    assert find_asked_bound(question) is asks


def test_what_is_left_out_or_computed_is_echoed() -> None:
    kind = Number()
    assert kind.describe(QUESTION, kind.read(QUESTION, "5 ms because 2I/c")) == '5 ms (left out: "because 2I/c")'
    assert kind.describe(QUESTION, kind.read(QUESTION, "0.1/20*1000 ms")) == "5 ms"
    assert kind.describe(QUESTION, kind.read(QUESTION, "5 ms")) == "5 ms"


def test_nothing_untrue_is_said() -> None:
    with pytest.raises(InvalidAnswer) as refused:
        read_quantity("0.1/20*1000 kg", "ms")
    assert "power of ten" not in str(refused.value)
    verdict = Number().grade(QUESTION, read_quantity("200 ms", "ms"))
    assert verdict.diagnosis == "Your number is the reciprocal of what is asked: swap numerator and denominator."
