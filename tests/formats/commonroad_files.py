"""Scenarios of CommonRoad, written by the tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stylesim.tracks import AgentKind
from tests.formats.traffic import Row, rows

KINDS = {AgentKind.CAR: "car", AgentKind.TRUCK: "truck", AgentKind.PEDESTRIAN: "pedestrian"}


def _bound(name: str, line: list[tuple[float, float]]) -> str:
    points = "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x, y in line)
    return f"<{name}>{points}<lineMarking>solid</lineMarking></{name}>"


def lanelet(lane_id: int, x: tuple[float, float], y: float, links: str, *, new: bool) -> str:
    """A straight lanelet eastward of 3.5 m around y."""
    left, right = ([(v, y + side) for v in (x[0], sum(x) / 2, x[1])] for side in (1.75, -1.75))
    bounds = _bound("leftBound", left) + _bound("rightBound", right)
    if new:
        # As the format has it: stop line, type, then references.
        stop = "<stopLine><lineMarking>solid</lineMarking></stopLine>" if lane_id == 1 else ""
        rest = f"{stop}<laneletType>urban</laneletType><trafficSignRef ref='20'/>"
        rest += "<trafficLightRef ref='30'/>" if lane_id == 1 else ""
    else:
        rest = "<speedLimit>13.4112</speedLimit>"
    return f'<lanelet id="{lane_id}">{bounds}{links}{rest}</lanelet>'


def _state(tag: str, r: Row) -> str:
    values = (("time", r.frame), ("orientation", r.heading), ("velocity", float(np.hypot(r.vx, r.vy))))
    exact = "".join(f"<{name}><exact>{value}</exact></{name}>" for name, value in values)
    return f"<{tag}><position><point><x>{r.x:.4f}</x><y>{r.y:.4f}</y></point></position>{exact}</{tag}>"


def _shape(r: Row) -> str:
    return f"<shape><rectangle><length>{r.length}</length><width>{r.width}</width></rectangle></shape>"


def scenario(*, name: str = "USA_Test-1_1_T-1", version: str = "2020a", table: list[Row] | None = None) -> str:
    """Two lanes one after the other and one beside them, a light, moving obstacles and a parked one."""
    new = version == "2020a"
    table = rows(n_frames=60) if table is None else table
    parts = [
        lanelet(1, (-120, 20), 0.0, '<successor ref="3"/><adjacentLeft ref="2" drivingDir="same"/>', new=new),
        lanelet(2, (-120, 20), 3.5, '<adjacentRight ref="1" drivingDir="same"/>', new=new),
        lanelet(3, (20, 140), 0.0, '<predecessor ref="1"/><successor ref="99"/>', new=new),
    ]
    if new:
        parts.append(
            '<trafficSign id="20"><trafficSignElement><trafficSignID>R2-1</trafficSignID><additionalValue>13.4112'
            "</additionalValue></trafficSignElement><virtual>true</virtual></trafficSign>"
        )
        cycle = "".join(
            f"<cycleElement><duration>{n}</duration><color>{colour}</color></cycleElement>"
            for n, colour in ((20, "red"), (5, "redYellow"), (10, "green"), (3, "yellow"))
        )
        parts.append(
            f'<trafficLight id="30"><cycle>{cycle}<timeOffset>4</timeOffset></cycle><active>true</active>'
            "</trafficLight>"
        )
        parts.append(
            '<intersection id="40"><incoming id="41"><incomingLanelet ref="1"/><successorsStraight ref="3"/>'
            "</incoming></intersection>"
        )
    tag, role = ("dynamicObstacle", "") if new else ("obstacle", "<role>dynamic</role>")
    for agent in sorted({r.agent for r in table}):
        own = [r for r in table if r.agent == agent]
        states = "".join(_state("state", r) for r in own[1:])
        trajectory = f"<trajectory>{states}</trajectory>" if states else ""
        parts.append(
            f'<{tag} id="{100 + agent}">{role}<type>{KINDS[own[0].kind]}</type>{_shape(own[0])}'
            f"{_state('initialState', own[0])}{trajectory}</{tag}>"
        )
    parked = Row(200, 0, 0.0, 60.0, -4.0, 0.0, 0.0, 0.1, 4.5, 1.8, AgentKind.CAR)
    still, role = ("staticObstacle", "") if new else ("obstacle", "<role>static</role>")
    kind = "parkedVehicle"
    parts.append(
        f'<{still} id="200">{role}<type>{kind}</type>{_shape(parked)}{_state("initialState", parked)}</{still}>'
    )
    head = f'<commonRoad commonRoadVersion="{version}" benchmarkID="{name}" timeStepSize="0.1">'
    return f'<?xml version="1.0"?>\n{head}\n' + "\n".join(parts) + "\n</commonRoad>\n"


def write(folder: Path, **options: str) -> Path:
    """The scenario as a file."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{options.get('name', 'USA_Test-1_1_T-1')}.xml"
    path.write_text(scenario(**options))  # type: ignore[arg-type]
    return path


def sample(folder: Path) -> Path:
    """Two cuts of one site, one of each version."""
    write(folder)
    write(folder, name="USA_Test-2_3_T-1", version="2018b")
    return folder
