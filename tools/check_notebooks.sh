#!/usr/bin/env bash
# Executes every notebook from the built wheel, in an environment of its own, in an empty folder.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
.venv/bin/python -m build --wheel --outdir "$work" . >"$work/build.log" 2>&1 || { cat "$work/build.log"; exit 1; }
"$(readlink -f .venv/bin/python)" -m venv "$work/env"
# shellcheck disable=SC2086
"$work/env/bin/pip" install --quiet --disable-pip-version-check ${PIP_ARGS:-} -c constraints.txt \
  "$(ls "$work"/*.whl)[all,tutorial]" nbclient ipykernel nbformat
mkdir "$work/run" && cp -r data "$work/run/data"
cd "$work/run"
for notebook in "$root"/notebooks/*.ipynb; do
  echo "executing $(basename "$notebook") …"
  "$work/env/bin/python" - "$notebook" <<'PY'
import sys
import nbformat
from nbclient import NotebookClient
book = nbformat.read(sys.argv[1], as_version=4)
NotebookClient(book, timeout=1200, kernel_name="python3").execute()
print("  ok,", sum(cell.cell_type == "code" for cell in book.cells), "code cells")
PY
done
