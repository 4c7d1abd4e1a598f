"""`stylesim`: the verbs in one application, and what a user sees when something goes wrong."""

from __future__ import annotations

import os
import sys
import traceback

import typer

from stylesim.version import __version__
from stylesim.cli import corpora, describing, forecasting, generating, labelling
from stylesim.cli.console import err
from stylesim.errors import StylesimError

app = typer.Typer(
    name="stylesim",
    help="Traffic with drivers of every style: generate, read, label, merge, train, evaluate.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
for module in (generating, corpora, labelling, forecasting, describing):
    module.add_to(app)


def _version(shown: bool) -> None:
    if shown:
        sys.stdout.write(f"stylesim {__version__}\n")
        raise typer.Exit


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
    except KeyboardInterrupt:
        err("interrupted; nothing half-written is left. Repeat the command with --resume to go on from here.")
        raise SystemExit(130) from None
    except Exception as error:  # noqa: BLE001 - the last resort: a message, and the traceback on request
        _report(error, f"internal error: {type(error).__name__}: {error}\nRun `stylesim --debug …` for the traceback.")
        raise SystemExit(70) from None


def _report(error: BaseException, text: str) -> None:
    if os.environ.get("STYLESIM_DEBUG"):
        traceback.print_exception(error)
    err(text)
