"""Choose one of several options before a simulation shows which is right."""

from grader.questions.kinds.predict.kind import Predict, PredictQuestion

__all__ = ["Predict", "PredictQuestion"]
