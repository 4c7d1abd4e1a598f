"""A small simulation as a user would have it: a crossing with a light, flows of cars, lorries and bicycles."""

from __future__ import annotations

import subprocess
from pathlib import Path

from stylesim.simulation.sumo.network import sumo_program

ARMS = {"w": (-300, 0), "e": (300, 0), "s": (0, -250), "n": (0, 250)}
FLOWS = (
    ("e", "w", "car", 900),
    ("s", "n", "car", 500),
    ("s", "w", "lorry", 120),
    ("w", "e", "car", 900),
    ("w", "e", "bike", 90),
)


def write_network(folder: Path) -> Path:
    """Compile the crossing into `folder`."""
    nodes = "".join(f'<node id="{name}" x="{x}" y="{y}"/>' for name, (x, y) in ARMS.items())
    edge = '<edge id="{id}" from="{a}" to="{b}" numLanes="2" speed="16.67"/>'
    edges = "".join(edge.format(id=f"{a}c", a=a, b="c") + edge.format(id=f"c{a}", a="c", b=a) for a in ARMS)
    (folder / "x.nod.xml").write_text(f'<nodes><node id="c" x="0" y="0" type="traffic_light"/>{nodes}</nodes>')
    (folder / "x.edg.xml").write_text(f"<edges>{edges}</edges>")
    net = folder / "crossing.net.xml"
    command = [str(sumo_program("netconvert")), "-n", "x.nod.xml", "-e", "x.edg.xml", "-o", str(net)]
    subprocess.run(command, check=True, cwd=folder, capture_output=True)
    return net


def write_routes(folder: Path, *, model: str = "Krauss") -> Path:
    """Flows for 600 s; the cars follow by that car-following model."""
    flows = "".join(
        f'<flow id="{a}{b}{kind}" type="{kind}" from="{a}c" to="c{b}" begin="0" end="600" vehsPerHour="{n}"'
        ' departLane="best" departSpeed="max"/>'
        for a, b, kind, n in FLOWS
    )
    types = (
        f'<vType id="car" carFollowModel="{model}" length="4.7" maxSpeed="50"/><vType id="lorry" vClass="truck"/>'
        '<vType id="bike" vClass="bicycle"/>'
    )
    path = folder / f"{model}.rou.xml"
    path.write_text(f"<routes>{types}{flows}</routes>")
    return path
