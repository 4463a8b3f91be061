"""What only shows when a well-formed question is tried: its lab is run, its exercise planned."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from grader.domain.lab import IntegratorsLab, LabConfig
from grader.domain.quiz import CodeQuestion, PredictQuestion
from grader.errors import Fault, NotFound
from grader.grading.exercise import check_exercise
from grader.labs.lab import check_integrators, check_lab
from grader.library.crossings import named_models
from grader.library.json_text import join
from grader.library.schema import Reading


def meaning_faults(reading: Reading, models: Mapping[str, str], file: str) -> Iterator[Fault]:
    """Faults of exercises and labs over the `models` that compile; that another is missing is told already."""

    def model_xml(name: str) -> str:
        if name not in models:
            raise NotFound(f"There is no model {name!r}.")
        return models[name]

    for question in reading.questions:
        if isinstance(question, CodeQuestion):
            wanted = {name for _, name in named_models(dict(question.check.parameters), "")}
            yield from check_exercise(question, model_xml, file) if wanted <= set(models) else ()
        elif isinstance(question, PredictQuestion) and question.sim is not None:
            yield from lab_faults(question.sim, models, file, join(question.id, "sim"))
    for lab in reading.labs:
        yield from lab_faults(lab, models, file, lab.id)


def lab_faults(lab: LabConfig | IntegratorsLab, models: Mapping[str, str], file: str, key: str) -> Iterator[Fault]:
    """What is wrong with one lab, which needs a model's name or its own MJCF."""
    xml = lab.xml if isinstance(lab, LabConfig) else None
    if (lab.model is None) == (xml is None):
        yield Fault(file, join(key, "model"), "give either model, a name in models/, or xml, the model itself")
        return
    if xml is None:
        xml = models.get(lab.model or "")
    if xml is None:
        return
    found = check_integrators(lab, xml, key) if isinstance(lab, IntegratorsLab) else check_lab(lab, xml, key)
    yield from (replace(fault, file=file) for fault in found)
