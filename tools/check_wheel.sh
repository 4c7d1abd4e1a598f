#!/usr/bin/env bash
# Builds the wheel, installs it alone into a bare environment, and uses it from there.
set -euo pipefail
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
.venv/bin/python -m build --wheel --outdir "$work" . >"$work/build.log" 2>&1 || { cat "$work/build.log"; exit 1; }
wheel=$(ls "$work"/*.whl)
echo "wheel: $(basename "$wheel"), $(du -k "$wheel" | cut -f1) KiB"
python3=$(readlink -f .venv/bin/python)
"$python3" -m venv "$work/bare"
# The base package alone, without the extras: what a user of labels and highway-env installs.
# shellcheck disable=SC2086
"$work/bare/bin/pip" install --quiet --disable-pip-version-check ${PIP_ARGS:-} -c constraints.txt "$wheel"
cd "$work"
cat > use.py <<'PY'
import sys
import stylesim as ss
from stylesim.resources import data_root
assert "site-packages" in str(data_root()), data_root()
crowd = ss.Population.load("tdbm_spectrum").reweighted(aggressive=0.3)
if __name__ == "__main__":
    corpus = ss.generate("highway", crowd, episodes=1, seed=7, out="sim")
    labels = ss.label(corpus, ss.TDBM().fit(corpus))
    assert len(labels) > 0
    assert not {"torch", "libsumo", "matplotlib"} & set(sys.modules)
    print("from the wheel:", len(corpus), "episode,", len(labels), "labels")
PY
bare/bin/python -W error::DeprecationWarning:stylesim use.py
bare/bin/stylesim --version
bare/bin/stylesim list scenarios >/dev/null
bare/bin/stylesim verify sim >/dev/null
if bare/bin/stylesim generate yellow_light --episodes 1 --out sumo 2>error.txt; then
  echo "generate with SUMO must fail without the extra" >&2; exit 1
fi
grep -q "stylesim\[sumo\]" error.txt || { cat error.txt; exit 1; }
echo "wheel: ok"
