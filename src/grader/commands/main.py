"""The command line, `grader ...`: assembles the groups of commands, and turns errors into exit codes.

What only some commands need is imported in them: MuJoCo, SQLAlchemy and pydantic take several times as long as the rest
of a short command.
"""

import copy
import gc
import os
import sys
from collections.abc import Callable, Sequence
from typing import Annotated

import typer
from typer.main import get_command_name
from typer.models import TyperInfo

from grader.commands import author, bench, check, demo, grade, new, operate, platforms, serve, teach, tokens
from grader.commands.options import FAULT, USAGE, complain
from grader.errors import CallerError, ContentError, InvalidAnswer, JailFault, NotReady, PluginError

STDERR = 2

YOUNG_OBJECTS = 300_000
"""New objects between two looks for garbage cycles. Imports make fewer, and hardly any garbage; with Python's own 700
the looks took a tenth of a short command and of a server's start."""

cli = typer.Typer(
    help="Auto-grading of a MuJoCo course.", no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False
)
for group in (serve.cli, demo.cli, grade.cli, check.cli, author.cli, bench.cli, teach.cli):
    cli.add_typer(group)
cli.add_typer(new.cli, name="new")
cli.add_typer(tokens.token, name="token")
cli.add_typer(operate.cli)
cli.add_typer(teach.pack, name="pack")
cli.add_typer(teach.roster, name="roster")
cli.add_typer(platforms.lti, name="lti")


def main(run: Callable[[], object] | None = None) -> None:
    """Runs a command. Every error that is the caller's becomes a line on stderr and an exit code."""
    open_missing_standard_streams()
    gc.set_threshold(YOUNG_OBJECTS)
    try:
        (run or find_commands(sys.argv[1:]))()
    except ContentError as error:
        complain(*map(str, error.faults))
        sys.exit(USAGE)
    except (CallerError, InvalidAnswer, NotReady, OSError, UnicodeDecodeError) as error:
        complain(describe_error(error))
        sys.exit(USAGE)
    except (JailFault, PluginError) as error:
        complain(str(error))
        sys.exit(FAULT)
    except ValueError as error:
        complain(*describe_faults(error))
        sys.exit(USAGE)
    finally:
        gc.freeze()  # the interpreter's end looks for garbage among all objects, for a fifth of a short command


def describe_error(error: Exception) -> str:
    """Returns what an error says; of a file of the system its name first."""
    is_of_file = isinstance(error, OSError) and error.filename is not None and error.strerror
    return f"{error.filename}: {error.strerror}" if is_of_file else str(error)  # type: ignore[attr-defined]


def find_commands(arguments: Sequence[str]) -> typer.Typer:
    """Returns the group of commands that has the first argument, or all groups where it is none, such as --help. Typer
    reads the signatures of all commands that it is given, for a tenth of a short command."""
    named = [group for group in cli.registered_groups if {*arguments[:1]} & list_names(group)]
    app = copy.copy(cli)
    app.registered_groups = named or cli.registered_groups
    return app


def list_names(group: TyperInfo) -> set[str]:
    """Returns the names with which the commands of a group begin: its own name, or theirs where it has none."""
    if isinstance(group.name, str):
        return {group.name}
    commands = [] if group.typer_instance is None else group.typer_instance.registered_commands
    return {
        command.name or get_command_name(command.callback.__name__)
        for command in commands
        if command.callback is not None
    }


def show_version(wanted: bool) -> None:
    """Prints the version, and ends."""
    if wanted:
        from importlib.metadata import version

        typer.echo(version("mujoco-grader"))
        raise typer.Exit


LOGGING = ("serve", "worker")
"""Commands that log every request or job; the others say what they do themselves."""


@cli.callback()
def begin(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=show_version, is_eager=True, help="The version.")
    ] = False,
) -> None:
    """Auto-grading of a MuJoCo course."""
    from grader.logs import log_to_stderr

    log_to_stderr(is_quiet=context.invoked_subcommand not in LOGGING)


def describe_faults(error: ValueError) -> list[str]:
    """Says what is wrong with the settings, a line for each. Raises the error again if they are not its cause."""
    from pydantic import ValidationError
    from pydantic_settings import SettingsError

    from grader.settings import PREFIX, Settings

    if isinstance(error, ValidationError):
        return [
            (f"{name_setting(*wrong['loc'])}: " if wrong["loc"] else "") + wrong["msg"].removeprefix("Value error, ")
            for wrong in error.errors()
            if wrong["type"] != "default_factory_not_called"  # it follows from another error
        ]
    if isinstance(error, SettingsError):  # not JSON where JSON is needed
        fields = [(name, field) for name, field in Settings.model_fields.items() if f'"{name}"' in str(error)]
        return [f"{PREFIX}{name.upper()} cannot be read. {field.description}" for name, field in fields]
    raise error


def name_setting(name: int | str, *inside: int | str) -> str:
    """Returns the variable of a setting, and the place within it."""
    from grader.settings import PREFIX

    return f"{PREFIX}{name}".upper() + "".join(f"[{part!r}]" for part in inside)


def open_missing_standard_streams() -> None:
    """Opens closed standard streams on /dev/null. Otherwise the next file would get their number, and their output."""
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= STDERR:
        pass
    os.close(descriptor)


if __name__ == "__main__":
    main()
