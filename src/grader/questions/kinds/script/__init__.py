"""Write a script, which is run in the jail and judged by simulating again."""

from grader.questions.kinds.script.kind import CheckSpec, Script, ScriptQuestion

__all__ = ["CheckSpec", "Script", "ScriptQuestion"]
