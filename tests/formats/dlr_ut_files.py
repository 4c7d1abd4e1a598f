"""Files in the format of DLR Urban Traffic, written by the tests."""

from __future__ import annotations

import gzip
from datetime import UTC, datetime, timedelta
from pathlib import Path

HEADER = (
    "timestamp,id,center_easting,center_northing,velocity_easting,velocity_northing,velocity_magnitude,"
    "acceleration_easting,acceleration_northing,acceleration_magnitude,yaw,dimension_length,dimension_width,"
    "dimension_height,classifications_pedestrian,classifications_bicycle,classifications_motorbike,"
    "classifications_car,classifications_van,classifications_truck,interpolated"
)
COLUMNS = tuple(HEADER.split(","))
BEGIN = datetime(2023, 9, 24, 12, 0, 0, tzinfo=UTC)
STAMP = "230924-120000_230924-120100"
ORIGIN = (700000.0, 5700000.0)  # far from the site whose road is shipped


def stamp_of(time: datetime) -> str:
    """As the source writes it: no fraction where it is zero."""
    return time.isoformat(sep=" ")


def rows(
    *, n_agents: int = 3, n_frames: int = 100, speed_mps: float = 10.0, interpolated: tuple[tuple[int, int], ...] = ()
) -> list[dict[str, object]]:
    """Cars driving east in lanes 10 m apart; `interpolated` are (agent, frame) pairs."""
    made: list[dict[str, object]] = []
    for frame in range(n_frames):
        for agent in range(n_agents):
            row: dict[str, object] = dict.fromkeys(COLUMNS, 0.0)
            row |= {
                "timestamp": stamp_of(BEGIN + timedelta(milliseconds=50 * frame)),
                "id": 1695556712692966 + agent,
                "center_easting": round(ORIGIN[0] + speed_mps * frame * 0.05, 3),
                "center_northing": ORIGIN[1] + 10.0 * agent,
                "velocity_easting": speed_mps,
                "yaw": 0.0,
                "dimension_length": 4.5,
                "dimension_width": 1.8,
                "classifications_car": 0.9,
                "interpolated": (agent, frame) in interpolated,
            }
            made.append(row)
    return made


def csv_text(table: list[dict[str, object]]) -> str:
    """The rows as the source's CSV."""
    return "\n".join([",".join(COLUMNS), *(",".join(str(row[c]) for c in COLUMNS) for row in table)]) + "\n"


def write(folder: Path, table: list[dict[str, object]], *, stamp: str = STAMP) -> Path:
    """A trajectories file with those rows."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"trajectories_{stamp}.csv.gz"
    path.write_bytes(gzip.compress(csv_text(table).encode(), mtime=0))
    return path


def write_lights(folder: Path, events: list[tuple[float, int, int]], *, stamp: str = STAMP) -> Path:
    """A lights file; events are (seconds after BEGIN, id, state)."""
    lines = [f"{stamp_of(BEGIN + timedelta(seconds=t))},{i},{state}" for t, i, state in events]
    path = folder / f"traffic-lights_{stamp}.csv.gz"
    path.write_bytes(gzip.compress(("timestamp,id,state\n" + "\n".join(lines) + "\n").encode(), mtime=0))
    return path


def sample(folder: Path) -> Path:
    """A recording of 45 s with lights, interpolated rows and a damaged one."""
    table = rows(n_frames=900, interpolated=((0, 30), (0, 31), (1, 899)))
    table[3]["timestamp"] = "garbage"
    write(folder, table)
    write_lights(folder, [(float(t), 1, 3 + 2 * (t % 2)) for t in range(45)])
    return folder
