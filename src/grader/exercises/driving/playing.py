"""Plays the trials of a kind that simulates in our own process: the student's function is asked step by step, in the
jail, and nothing that is not asked enters it. The visible trials come first, as the harness runs them."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from grader.domain.progress import TrialProgress
from grader.domain.run import Channel, ChannelClosed
from grader.exercises.kind import Kind, Trial
from grader.exercises.parameters import ExerciseParameters


class TrialRaised(Exception):
    """The driver has raised outside of a step, such as where a function is missing; the result `raised` says what."""


@dataclass(frozen=True)
class Asking:
    """Asks the driver in one trial, and tells how far it is: the `Ask` of a kind that plays. What is told of a hidden
    trial is dropped, since a script that knows its numbers could choose when."""

    channel: Channel
    index: int
    hidden: bool

    def __call__(self, message: bytes, /) -> bytes:
        """Returns the answer. Raises TrialRaised where the driver has none, and ChannelClosed."""
        answer = self.channel.ask(message)
        if not answer:
            raise TrialRaised
        return answer

    def tell(self, progress: TrialProgress, /) -> None:
        """Tells how far the trial is."""
        if not self.hidden:
            self.channel.tell(f"t{self.index}_at_{progress.at}_of_{progress.of}_{progress.unit}")


Talk = Callable[[Channel], "Played"]


@dataclass
class Played:
    """What `play` returned, by the trial's index; without trials that raised outside of a step. `stopped_at` is the
    index of the trial in which the script ended, and `place` says where in it; None where all were played."""

    records: dict[int, Any] = field(default_factory=dict)
    stopped_at: int | None = None
    place: str = ""


def play_trials(
    kind: Kind[Any, Any, Any], parameters: ExerciseParameters, trials: Sequence[Trial[Any]], channel: Channel
) -> Played:
    """Plays trials one after the other, until the script ends. Raises MalformedAnswer."""
    played = Played()
    order = sorted(range(len(trials)), key=lambda index: trials[index].hidden)
    asked_for_hidden = False
    for index in order:
        trial = trials[index]
        try:
            if trial.hidden and not asked_for_hidden:
                channel.wait_for_hidden()
                asked_for_hidden = True
            if trial.cpu_s is not None:
                channel.limit(trial.cpu_s)
            with suppress(TrialRaised):
                played.records[index] = kind.play(parameters, trial, Asking(channel, index, trial.hidden))
            channel.end()
        except ChannelClosed as closed:
            played.stopped_at = index
            played.place = "" if trial.hidden else " ".join(getattr(closed, "__notes__", ()))
            return played
        if not trial.hidden:
            channel.tell(f"t{index}_played")
    return played


def describe_stop(played: Any, titles: Sequence[str]) -> str:
    """Returns a sentence on where a script ended, with a space before it; empty where that is not known."""
    if not isinstance(played, Played) or played.stopped_at is None:
        return ""
    return f" It was in {', '.join(filter(None, (titles[played.stopped_at], played.place)))}."
