"""`python -m stylesim`: the command line."""

from stylesim.cli import main

main()
