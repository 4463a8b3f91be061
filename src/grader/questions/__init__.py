"""Quizzes and their questions; each question is of a kind, which is a plug-in. A kind imports from here alone."""

from grader.domain.pages.markup import plain_text, quoted
from grader.domain.plugins import Remark
from grader.domain.verdict import Finding, Status, Verdict, verdict_of
from grader.domain.verify import Verify
from grader.errors import InvalidAnswer
from grader.questions.answer_keys import AnswerKey, NumberKey, OptionKey
from grader.questions.forms import FORMS, Form, Takes, decode_file, describe_file, write_module
from grader.questions.kind import FIELD, CountedNumber, Example, Fields, Option, QuestionKind, typed_in
from grader.questions.parts import field_of, json_or_text, typed_for
from grader.questions.question import ModelXml, OptionIndex, Options, Question, Reveal, Whys
from grader.questions.quiz import LessonHead, Quiz
from grader.questions.registry import (
    GROUP,
    AnyKind,
    carry_over,
    fill_form,
    grade_answer,
    installed_kinds,
    is_own,
    kind_of,
    parse_question,
    question_adapter,
    read_answer,
    show_answer,
    template_of,
)
from grader.questions.student_view import lab_view, question_view, student_view, unopened_view

__all__ = [
    "FIELD", "FORMS", "GROUP", "AnswerKey", "AnyKind", "CountedNumber", "Example", "Fields", "Finding", "Form",
    "InvalidAnswer", "LessonHead", "ModelXml", "NumberKey", "Option", "OptionIndex", "OptionKey", "Options",
    "Question", "QuestionKind", "Quiz", "Remark", "Reveal", "Status", "Takes", "Verdict", "Verify", "Whys",
    "carry_over", "decode_file", "describe_file", "field_of", "fill_form", "grade_answer", "installed_kinds", "is_own",
    "json_or_text",
    "kind_of", "lab_view", "parse_question", "plain_text", "question_adapter", "question_view", "quoted", "read_answer",
    "show_answer", "student_view", "template_of", "typed_for", "typed_in", "unopened_view", "verdict_of",
    "write_module",
]  # fmt: skip
