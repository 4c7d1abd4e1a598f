#!/usr/bin/env bash
# Makes .venv with everything that stylesim needs, at the versions of constraints.txt. Run by make; safe to repeat.
# Usage: tools/install.sh EXTRA   (EXTRA: all, or dev for tests and linters)
# PIP_ARGS is passed to pip, e.g. PIP_ARGS="--index-url … --extra-index-url …" for a CPU build of torch.
set -euo pipefail
cd "$(dirname "$0")/.."
extra=${1:-all}
python=${PYTHON:-python3}
mark=.venv/.installed-$extra
stamp=$(cat pyproject.toml constraints.txt tools/install.sh | sha256sum | cut -d' ' -f1)
if [ -f "$mark" ] && [ "$(cat "$mark")" = "$stamp" ]; then
  exec tools/sumo_libraries.sh
fi
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
  echo "stylesim needs Python 3.11 or newer; found $("$python" --version). Set PYTHON=… and run make again." >&2
  exit 1
}
cat <<'TEXT'
Setting up .venv. Downloads, unless pip has them already: about 0.6 GB with a CPU build of torch, about 3.3 GB with
the CUDA build that the registry gives by default on Linux. For the CPU build, stop now (Ctrl-C) and run, for example,
  make demo PIP_ARGS="--extra-index-url <index of CPU wheels of torch>"
TEXT
[ -x .venv/bin/python ] || "$python" -m venv .venv
# shellcheck disable=SC2086  # PIP_ARGS is meant to be split
.venv/bin/python -m pip install --quiet --disable-pip-version-check ${PIP_ARGS:-} -c constraints.txt -e ".[$extra]"
tools/sumo_libraries.sh
echo "$stamp" > "$mark"
