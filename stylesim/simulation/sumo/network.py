"""Compiles a scenario's plain XML with `netconvert`, into a cache keyed by content and SUMO version."""

from __future__ import annotations

import hashlib
import subprocess
import tempfile
import xml.etree.ElementTree as ET
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from stylesim.errors import MissingDependencyError, SimulationError
from stylesim.resources import cache_dir
from stylesim.scenario import Scenario
from stylesim.simulation.sumo.options import SumoOptions, source_files

INSTALL = "install it with: pip install 'stylesim[sumo]'"
NETCONVERT_OPTIONS = (
    "--no-turnarounds",
    "--offset.disable-normalization",
    "--output.street-names=false",
    "--precision=4",  # 0.1 mm: a lane of 0.3 m that is drawn 0.02 m shorter shows as 2 m/s2
    "--junctions.corner-detail=8",
    "--junctions.internal-link-detail=24",  # points of the lane of a turn, because the tracks follow them
    "--junctions.limit-turn-speed=1.4",  # mean lateral m/s2 at the limit; chosen, because the boldest then reach 4
)


def sumo_version() -> str:
    """The version of the installed SUMO programs; MissingDependencyError if there are none."""
    try:
        return version("eclipse-sumo")
    except PackageNotFoundError:
        raise MissingDependencyError(f"SUMO is not installed; {INSTALL}") from None


def sumo_program(name: str) -> Path:
    """The path of one of SUMO's programs ("sumo", "netconvert"); MissingDependencyError if it is not there."""
    spec = find_spec("sumo")
    folders = [] if spec is None or not spec.submodule_search_locations else list(spec.submodule_search_locations)
    for folder in folders:
        for path in (Path(folder) / "bin" / name, Path(folder) / "bin" / f"{name}.exe"):
            if path.is_file():
                return path
    raise MissingDependencyError(f"SUMO's program {name!r} was not found; {INSTALL}")


def edge_types_xml(options: SumoOptions, speed_limit_mps: float) -> str:
    """The type file: one line per edge type with its speed limit in m/s."""
    lines = ["<types>"]
    for name in sorted(options.edge_types):
        kind = options.edge_types[name]
        limit = kind.limit_mps if kind.limit_mps is not None else (kind.of_limit or 1.0) * speed_limit_mps
        lines.append(f'    <type id="{name}" speed="{limit:.4f}"/>')
    return "\n".join([*lines, "</types>", ""])


def compiled_network(scenario: Scenario, options: SumoOptions, *, speed_limit_mps: float) -> Path:
    """The compiled network, made if it is not in the cache.

    The key is the sha256 of the sources, the edge types, netconvert's options and SUMO's version; the file
    appears under its final name only when whole, so that any number of processes may ask at once.
    Raises SimulationError with netconvert's words where the sources cannot be compiled.
    """
    sources = source_files(scenario, options)
    types = edge_types_xml(options, speed_limit_mps)
    digest = hashlib.sha256("\0".join([sumo_version(), types, *NETCONVERT_OPTIONS]).encode())
    for kind in sorted(sources):
        digest.update(b"\0" + kind.encode() + b"\0" + sources[kind].read_bytes())
    folder = cache_dir() / "nets"
    target = folder / f"{digest.hexdigest()}.net.xml"
    if target.is_file():
        return target
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix="compiling-") as work:
        made = _compile(sources, types, Path(work), scenario.name)
        made.replace(target)
    return target


def _compile(sources: dict[str, Path], types: str, work: Path, name: str) -> Path:
    type_file, made = work / "types.typ.xml", work / "made.net.xml"
    type_file.write_text(types, encoding="utf-8")
    command = [str(sumo_program("netconvert")), "-n", str(sources["nodes"]), "-e", str(sources["edges"])]
    command += ["-x", str(sources["connections"]), "-t", str(type_file), "-o", str(made), *NETCONVERT_OPTIONS]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    if done.returncode != 0 or not made.is_file():
        words = "\n".join(line for line in (done.stderr + done.stdout).splitlines() if line.strip())
        raise SimulationError(f"scenario {name!r}: netconvert could not compile its network:\n{words}")
    _check_has_lanes(made, name)
    return made


def _check_has_lanes(path: Path, name: str) -> None:
    """SUMO dies of a segmentation fault on a network without edges, so such a one never gets there."""
    for _, element in ET.iterparse(path):
        if element.tag == "lane":
            return
    raise SimulationError(f"scenario {name!r}: its network has no lanes; check its edges file")
