"""A network of the user's: SUMO's own, OpenStreetMap or OpenDRIVE, as a network that this SUMO can run."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from stylesim.errors import InputError
from stylesim.simulation.sumo.network import sumo_program
from stylesim.xmlfiles import parse, root_name

PATIENCE_S = 300.0  # chosen, because netconvert takes about a minute for a city's centre
KINDS = {"net": "SUMO network", "osm": "OpenStreetMap", "OpenDRIVE": "OpenDRIVE"}  # by root element
IMPORT_OPTIONS = (
    "--geometry.remove",
    "--junctions.join",
    "--tls.guess-signals",
    "--tls.discard-simple",
    "--tls.join",
    "--keep-edges.by-vclass",
    "passenger",
    "--no-turnarounds.except-deadend",
    "--output.street-names=false",
    "--junctions.corner-detail=8",
    "--junctions.internal-link-detail=24",
    "--precision=4",
)
SOURCE_OPTIONS = {"osm": ("--remove-edges.isolated", "--osm-files"), "OpenDRIVE": ("--opendrive-files",)}


def import_network(source: Path, target: Path) -> str:
    """Writes the network that `source` describes to `target`; its kind ("net", "osm", "OpenDRIVE").

    A SUMO network is taken as it is; OpenStreetMap and OpenDRIVE go through netconvert (roads for cars only). Both are
    tried in a process of their own, because SUMO dies of some files. InputError that names the file and says why.
    """
    if not source.is_file():
        raise InputError(f"no such file: {source}")
    kind = root_name(source)
    if kind not in KINDS:
        raise InputError(
            f"{source} is no network: its root element is <{kind[:80] or '?'}>; expected <net> (SUMO), <osm> "
            "(OpenStreetMap) or <OpenDRIVE>, unpacked"
        )
    root = parse(source, root=kind)  # no document type, bounded, whole
    if kind == "net":
        if root.find("edge/lane") is None:
            raise InputError(f"{source}: the network has no lanes")
        shutil.copyfile(source, target)
    else:
        command = [str(sumo_program("netconvert")), *IMPORT_OPTIONS, *SOURCE_OPTIONS[kind], str(source)]
        _run([*command, "-o", str(target)], source, "netconvert")
        if not target.is_file() or parse(target, root="net").find("edge/lane") is None:
            raise InputError(f"{source}: nothing for cars is in it; netconvert made a network without lanes")
    trial = [str(sumo_program("sumo")), "-n", str(target), "--begin", "0", "--end", "1", "--no-step-log"]
    _run([*trial, "--xml-validation", "never", "--no-warnings", "--duration-log.disable"], source, "SUMO")
    return kind


def _run(command: list[str], source: Path, name: str) -> None:
    """InputError with the program's words where it fails or dies."""
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", check=False, timeout=PATIENCE_S
        )
    except subprocess.TimeoutExpired:
        raise InputError(f"{source}: {name} was not done after {PATIENCE_S:g} s; cut a smaller piece") from None
    if done.returncode == 0:
        return
    said = [line for line in (done.stderr + done.stdout).splitlines() if "rror" in line] or ["it said nothing"]
    end = f"died (signal {-done.returncode})" if done.returncode < 0 else "refuses it"
    raise InputError(f"{source}: {name} {end}: " + "\n".join(said[:10]))
