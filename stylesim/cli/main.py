"""`stylesim`: the verbs in one application, and what a user sees when something goes wrong."""

from __future__ import annotations

import os
import sys
import traceback
from typing import Any

import typer
from typer.core import TyperGroup

from stylesim import __version__
from stylesim.cli import (
    analyzing,
    calibrating,
    comparing,
    corpora,
    describing,
    evaluating,
    examining,
    experimenting,
    exporting,
    generating,
    labelling,
    measuring,
    predicting,
    replaying,
    safety,
    stressing,
    training,
)
from stylesim.cli.console import err
from stylesim.errors import StylesimError

INTERRUPTED = 130  # 128 + SIGINT, as shells count


class Verbs(TyperGroup):
    """The verbs; an interrupt says what to do next (typer alone would end without a word)."""

    def invoke(self, ctx: Any) -> Any:
        """Run the verb."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            verb = self.commands.get(ctx.invoked_subcommand or "")
            resumes = verb is not None and any(parameter.name == "resume" for parameter in verb.params)
            again = "with --resume to go on from what was finished" if resumes else "to start anew"
            err(f"interrupted; nothing half-written is left under a final name. Repeat the command {again}.")
            raise SystemExit(INTERRUPTED) from None


app = typer.Typer(
    name="stylesim",
    cls=Verbs,
    help="Traffic with drivers of every style: generate, read, label, merge, train, evaluate.",
    epilog=(
        "First steps: `stylesim list scenarios`, `stylesim generate yellow_light --episodes 4 --out runs/sim`, "
        "`stylesim label runs/sim`."
    ),
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
for module in (
    generating,
    calibrating,
    corpora,
    labelling,
    measuring,
    safety,
    comparing,
    analyzing,
    training,
    evaluating,
    predicting,
    examining,
    experimenting,
    stressing,
    exporting,
    describing,
    replaying,
):
    module.add_to(app)


def _version(shown: bool) -> bool:
    if shown:
        sys.stdout.write(f"stylesim {__version__}\n")
        raise typer.Exit
    return shown


@app.callback()
def options(
    debug: bool = typer.Option(False, "--debug", help="Show the traceback of an error."),
    version: bool = typer.Option(False, "--version", callback=_version, is_eager=True, help="Print the version."),
) -> None:
    """Options that every verb takes (before the verb)."""
    if debug:
        os.environ["STYLESIM_DEBUG"] = "1"


def main(argv: list[str] | None = None) -> None:
    """Run the command line; exits with 0, or with the error's code and its message on stderr."""
    try:
        app(args=argv)
    except StylesimError as error:
        _report(error, f"error: {error}")
        raise SystemExit(error.exit_code) from None
    except KeyboardInterrupt:  # before the verb began
        raise SystemExit(INTERRUPTED) from None
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        _report(error, f"error: {place}{error.strerror or error}")
        raise SystemExit(os.EX_IOERR) from None
    except MemoryError as error:
        _report(error, "error: out of memory; use fewer workers, smaller scenes, or a larger machine")
        raise SystemExit(os.EX_OSERR) from None
    except Exception as error:  # noqa: BLE001 - the last resort: a message, and the traceback on request
        _report(error, f"internal error: {type(error).__name__}: {error}\nRun `stylesim --debug …` for the traceback.")
        raise SystemExit(os.EX_SOFTWARE) from None


def _report(error: BaseException, text: str) -> None:
    if os.environ.get("STYLESIM_DEBUG"):
        traceback.print_exception(error)
    err(text)
