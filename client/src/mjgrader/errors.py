"""Errors: each is a sentence that says what to do."""


class Sentence(Exception):
    """An error that a learner reads: one sentence, with the cure. In a notebook it comes without a traceback."""

    def _render_traceback_(self) -> list[str]:
        """Returns what IPython shows in place of a traceback."""
        return [str(self)]


class NotRunning(Sentence):
    """A script that does not run in a fresh process; `output` is what it printed."""

    def __init__(self, sentence: str, output: str = "") -> None:
        super().__init__("\n".join(filter(None, (output, sentence))))
        self.output = output


class Offline(Sentence):
    """The server cannot be reached."""


class SignInAgain(Sentence):
    """The server does not know the token any more."""


class Refusal(Sentence):
    """The server has refused a request for good."""
