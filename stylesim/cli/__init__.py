"""The command line: parse, call one function, print."""

from stylesim.cli.main import main as main
