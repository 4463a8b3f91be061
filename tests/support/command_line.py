"""The command line in this process: a process of its own would take most of its time to import the grader."""

import subprocess
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from io import StringIO

from grader.commands.main import cli, main


class Terminal(StringIO):
    """What a person types."""

    def isatty(self) -> bool:
        return True


def grader(*arguments: str) -> subprocess.CompletedProcess[str]:
    """What `grader` with these arguments prints, and its exit code. A fault of the program itself is raised."""
    with redirect_stdout(StringIO()) as printed, redirect_stderr(StringIO()) as complaints:
        try:
            main(partial(cli, list(arguments), prog_name="grader"))
        except SystemExit as ended:
            code = ended.code
    assert isinstance(code, int)
    return subprocess.CompletedProcess(arguments, code, printed.getvalue(), complaints.getvalue())
