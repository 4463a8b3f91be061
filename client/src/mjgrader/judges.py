"""The judges of visible cases: the grader's own modules, by the kind of exercise.

In the wheel they are below mjgrader.shared, and the build rewrites these imports."""

from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any

from grader.exercises.judgement import Judgement, Results
from grader.exercises.kinds.rk4.judging import described as rk4
from grader.exercises.kinds.rk4.judging import driver as rk4_driver
from grader.exercises.kinds.threshold.judging import described as threshold
from grader.exercises.kinds.threshold.judging import driver as threshold_driver
from grader.exercises.kinds.values.judging import described as values
from grader.exercises.kinds.values.judging import driver as values_driver

Judge = Callable[[Mapping[str, Any], Mapping[str, Any], Results], Judgement[Any]]

JUDGES: Mapping[str, Judge] = {"rk4": rk4.judge, "threshold": threshold.judge, "values": values.judge}
DRIVERS: Mapping[str, ModuleType] = {"rk4": rk4_driver, "threshold": threshold_driver, "values": values_driver}
"""What calls the learner's functions in a trial."""
