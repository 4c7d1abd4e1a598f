#!/usr/bin/env bash
# SUMO's wheels need a few system libraries that a bare machine lacks. If `import libsumo` works, this does nothing.
# Root on Debian/Ubuntu: installs them. Another user there: unpacks them into .venv (no sudo). Elsewhere: says what to do.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$PWD/.venv/system-libraries
paths=$(find "$folder" -name '*.so*' -printf '%h\n' 2>/dev/null | sort -u | paste -sd: || true)
works() { LD_LIBRARY_PATH="$paths${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}" .venv/bin/python -c 'import libsumo' 2>/dev/null; }
works && exit 0
if command -v apt-get >/dev/null; then
  if [ "$(id -u)" = 0 ]; then
    echo "Installing the system libraries that SUMO needs (apt-get) …"
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
      libx11-6 libxext6 libxrender1 libgl1 libatomic1 >/dev/null
  else
    echo "Unpacking the system libraries that SUMO needs into .venv (12 packages, about 1.4 MB) …"
    work=$(mktemp -d)
    (cd "$work" && apt-get download -qq libx11-6 libxcb1 libxau6 libxdmcp6 libbsd0 libmd0 libxext6 libxrender1 \
      libgl1 libglvnd0 libglx0 libatomic1)
    mkdir -p "$folder"
    for package in "$work"/*.deb; do dpkg -x "$package" "$folder"; done
    rm -rf "$work"
    paths=$(find "$folder" -name '*.so*' -printf '%h\n' | sort -u | paste -sd:)
  fi
  works && exit 0
fi
cat >&2 <<'TEXT'
libsumo cannot be loaded: this machine lacks libX11, libXext, libXrender, libGL or libatomic. Install them, then run make
again. Debian/Ubuntu: apt-get install libx11-6 libxext6 libxrender1 libgl1 libatomic1
Fedora: dnf install libX11 libXext libXrender libglvnd-glx libatomic     Arch: pacman -S libx11 libxext libxrender libglvnd
TEXT
exit 1
