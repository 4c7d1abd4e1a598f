"""A site in the format of INTERACTION, written by the tests."""

from __future__ import annotations

from pathlib import Path

from stylesim.tracks import AgentKind
from tests.formats import lanelet2_files
from tests.formats.traffic import Row, rows, text

HEADER = "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,psi_rad,length,width"
KINDS = {AgentKind.CAR: "car", AgentKind.TRUCK: "truck", AgentKind.PEDESTRIAN: "pedestrian/bicycle"}


def vehicle_lines(table: list[Row]) -> list[tuple[object, ...]]:
    return [
        (r.agent, r.frame + 1, 100 * (r.frame + 1), KINDS[r.kind], r.x, r.y, r.vx, r.vy, r.heading, r.length, r.width)
        for r in table
        if r.kind != AgentKind.PEDESTRIAN
    ]


def write(folder: Path, table: list[Row] | None = None, *, number: str = "000") -> Path:
    """The track files of one recording."""
    folder.mkdir(parents=True, exist_ok=True)
    table = rows() if table is None else table
    (folder / f"vehicle_tracks_{number}.csv").write_text(text(HEADER, vehicle_lines(table)))
    people = [
        (f"P{r.agent}", r.frame + 1, 100 * (r.frame + 1), KINDS[r.kind], r.x, r.y, r.vx, r.vy)
        for r in table
        if r.kind == AgentKind.PEDESTRIAN
    ]
    (folder / f"pedestrian_tracks_{number}.csv").write_text(text(",".join(HEADER.split(",")[:8]), people))
    return folder


def sample(folder: Path) -> Path:
    """A root with one site of two recordings, a damaged row and a duplicate."""
    site = folder / "recorded_trackfiles" / "DR_TEST_Crossing_AA"
    write(site)
    write(site, rows(n_frames=60), number="001")
    with (site / "vehicle_tracks_000.csv").open("a") as file:
        file.write("1,1,100,car,0,0,9,0,0,4.2,1.8\n2,2,nan,car,0,0,9,0,0,4.2,1.8\n")
    (folder / "maps").mkdir()
    lanelet2_files.write(folder / "maps" / "DR_TEST_Crossing_AA.osm")
    return folder
