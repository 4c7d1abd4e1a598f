"""Tables in the formats of NGSIM, written by the tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stylesim.tracks import AgentKind
from tests.formats.traffic import Row, rows

PORTAL = (
    "Vehicle_ID,Frame_ID,Total_Frames,Global_Time,Local_X,Local_Y,Global_X,Global_Y,v_length,v_Width,v_Class,v_Vel,"
    "v_Acc,Lane_ID,O_Zone,D_Zone,Int_ID,Section_ID,Direction,Movement,Preceding,Following,Space_Headway,Time_Headway,"
    "Location"
)
FOOT = 0.3048
GLOBAL_FT = (2230000.0, 1375000.0)
CLASSES = {AgentKind.CAR: 2, AgentKind.TRUCK: 3, AgentKind.MOTORCYCLE: 1}


def fields(r: Row, begin_ms: int, first_frame: int = 3000) -> dict[str, object]:
    """The values of a row: feet, the middle of the front."""
    front = r.x + r.length / 2 * np.cos(r.heading), r.y + r.length / 2 * np.sin(r.heading)
    x, y = front[0] / FOOT, front[1] / FOOT
    return {
        "Vehicle_ID": r.agent, "Frame_ID": first_frame + r.frame, "Total_Frames": '"1,156"',
        "Global_Time": begin_ms + 100 * (first_frame + r.frame), "Local_X": round(-y, 3), "Local_Y": round(x, 3),
        "Global_X": round(GLOBAL_FT[0] + x, 3), "Global_Y": round(GLOBAL_FT[1] + y, 3),
        "v_length": round(r.length / FOOT, 2), "v_Width": round(r.width / FOOT, 2), "v_Class": CLASSES[r.kind],
        "v_Vel": round(float(np.hypot(r.vx, r.vy)) / FOOT, 3), "v_Acc": 0, "Lane_ID": 1,
    }  # fmt: skip


def cars(**options: int) -> list[Row]:
    return [r for r in rows(**options) if r.kind != AgentKind.PEDESTRIAN]


def portal_text(parts: list[tuple[str, int, list[Row]]]) -> str:
    """The portal's CSV of (site, time of frame 0 in ms, rows), newest row first as the portal has it."""
    lines = []
    for site, begin_ms, table in parts:
        for r in reversed(table):
            values = fields(r, begin_ms) | {"Location": site}
            lines.append(",".join(str(values.get(name, 0)) for name in PORTAL.split(",")))
    return "\ufeff" + "\n".join([PORTAL, *lines]) + "\n"


def original_text(begin_ms: int, table: list[Row]) -> str:
    """The original text of 18 columns."""
    names = [*PORTAL.split(",")[:14], "Preceding", "Following", "Space_Headway", "Time_Headway"]
    lines = []
    for r in table:
        values = fields(r, begin_ms) | {"Total_Frames": 1156}
        lines.append("  ".join(f"{values.get(name, 0)!s:>10}" for name in names))
    return "\n".join(lines) + "\n"


def sample(folder: Path) -> Path:
    """Two sites, one with two periods whose times overlap, a duplicate and a row whose time disagrees."""
    table = cars()
    text = portal_text([("peachtree", 1163018600, table), ("peachtree", 1163030300, table), ("us-101", 5000, table)])
    lines = text.splitlines()
    text = "\n".join([*lines, lines[5], lines[6].replace("1163", "9993")]) + "\n"
    path = folder / "portal.csv"
    path.write_text(text, encoding="utf-8")
    return path
