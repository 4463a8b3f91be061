"""Question: what every question has, whatever its kind; and the fields that several kinds share."""

from collections.abc import Callable, Sequence
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo
from pydantic_core import PydanticCustomError

from grader.domain.verify import Verify

ModelXml = Callable[[str], str]
"""Returns the MJCF text of a model of the content folder by name; raises NotFound if there is none."""

Reveal = Literal["direction", "size", "value"]
"""What the feedback on a wrong answer gives away, before the solution may be seen; each level includes the ones before.

- `direction`: whether it is too high or too low, or what is wrong;
- `size`: about how far it is off, and the slip behind it;
- `value`: what was expected.
"""


class Question(BaseModel):
    """The fields of every question. A kind derives its own model, which narrows `kind` to its names. Loading adds a
    missing `id` by position: q1, q2, ..."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")
    q: str = Field(min_length=1)
    label: str | None = None
    title: str | None = None
    explain: str | None = None
    points: float = Field(default=1.0, gt=0, le=1000, strict=True, allow_inf_nan=False)
    attempts: int | None = Field(default=None, ge=1, strict=True)
    verify: Verify | None = None
    kind: str


def _index_of_option(answer: int, info: ValidationInfo) -> int:
    options = info.data.get("options")
    if options is not None and answer >= len(options):
        which = {"answer": answer, "last": len(options) - 1}
        raise PydanticCustomError("option_index", "there is no option {answer}: they go from 0 to {last}", which)
    return answer


def _one_for_each_option(whys: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
    options = info.data.get("options")
    if whys and options is not None and len(whys) != len(options):
        counts = {"whys": len(whys), "options": len(options)}
        raise PydanticCustomError("whys", "there are {whys} sentences for {options} options: give each its own", counts)
    return whys


def check_distinct(texts: Sequence[str]) -> None:
    """Raises PydanticCustomError if two texts are equal but for white space: learners could not tell them apart."""
    seen = set[str]()
    for text in texts:
        words = " ".join(text.split())
        if words in seen:
            raise PydanticCustomError("repeated", "{text} is there twice: write each text once", {"text": repr(text)})
        seen.add(words)


def distinct_texts(texts: tuple[str, ...]) -> tuple[str, ...]:
    """Returns texts of which no two are equal. Raises PydanticCustomError."""
    check_distinct(texts)
    return texts


Options = Annotated[tuple[str, ...], Field(min_length=2, max_length=100), AfterValidator(distinct_texts)]
"""What a learner chooses from; each option of a certified question costs simulations."""

OptionIndex = Annotated[int, Field(ge=0, strict=True), AfterValidator(_index_of_option)]
"""The 0-based index of one of the `options`, a field that must be declared before it."""

Whys = Annotated[tuple[str, ...], AfterValidator(_one_for_each_option)]
"""A sentence on each of the `options`, a field that must be declared before it: why it is right or wrong."""
