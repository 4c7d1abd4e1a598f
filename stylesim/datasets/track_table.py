"""From a long table in standard columns to a checked `Recording`: what readers of tables share.

Standard columns: `agent` (text), `frame` (integer, from 0 on), `x`, `y` (m), and where the source has them `vx`, `vy`
(m/s) or `speed` (m/s, along the heading), `heading` (rad, counter-clockwise from +x), `length`, `width` (m), `kind`
(number of an `AgentKind`).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
from jaxtyping import Float64, Int64

from stylesim.datasets.accounting import row_counts
from stylesim.datasets.consistency import refuse_other_units
from stylesim.datasets.dense import MAX_LOST_SHARE
from stylesim.datasets.motion import backward_velocity, courses
from stylesim.datasets.plausible import MAX_DISTANCE_M, MAX_LENGTH_M, MAX_SPEED_MPS, MAX_WIDTH_M, MIN_SIDE_M
from stylesim.datasets.recording import NEVER, Recording, SignalLog
from stylesim.datasets.sizes import completed
from stylesim.errors import InputError
from stylesim.geometry import wrap_angle
from stylesim.tracks import MOTOR_KINDS, AgentKind

MAX_FRAME = 100_000_000  # chosen: 46 days at 25 Hz; a larger number is damaged
ORIGIN_ROWS = 50  # chosen: so many first rows outvote a few damaged ones
MAX_ANGLE_RAD = 1e4  # chosen: beyond it an angle is a damaged number
_MOTOR = [int(kind) for kind in MOTOR_KINDS]


@dataclass(frozen=True)
class Source:
    """Where a table comes from. `dropped` are the rows lost before it was one; checked rows are added."""

    file: Path
    recording_id: str
    dt_s: float
    dropped: dict[str, int]


def recording_of(
    table: pl.DataFrame, source: Source, *, signals: SignalLog | None = None, front: bool = False
) -> tuple[Recording, Float64[np.ndarray, " 2"]]:
    """The recording, and an origin near its first positions (full hectometres, in the source's frame).

    Missing velocities are backward differences, missing headings the direction of travel (see `motion`), missing
    sizes common ones of the kind. `front`: positions are of the middle of the front, and are moved to the centre.
    Dropped and counted: `unreadable`, `implausible` (faster than MAX_SPEED_MPS, larger than a road train, farther
    than MAX_DISTANCE_M from the origin), `duplicate` (a second row of an agent in a frame), `velocity_unknown` (a
    single position), `heading_unknown` (a motor vehicle that never moves, where the source gives no heading).
    InputError where the file as a whole is in other units.
    """
    dropped = dict(source.dropped)
    before = table.height
    table = _standard(table)
    table = _kept(table, _readable(table), "unreadable", dropped)
    if table.is_empty():
        raise InputError(f"{source.file} has no usable row" + _lost(dropped))
    origin = _origin(table)
    table = _kept(table, _plausible(table, origin), "implausible", dropped)
    if dropped["unreadable"] + dropped["implausible"] > MAX_LOST_SHARE * before or table.is_empty():
        raise InputError(
            f"{source.file}: {dropped['unreadable']} of {before} rows are not readable and {dropped['implausible']} "
            "cannot be road users in metres; it is damaged or in other units"
        )
    once = _once(table.sort("agent", "frame", maintain_order=True))
    dropped["duplicate"] = dropped.get("duplicate", 0) + table.height - once.height
    recording = _derived(once, source, signals, dropped, front=front)
    row_counts(rows_out=len(recording.frame), dropped=dropped, rows_in=before + sum(source.dropped.values()))
    refuse_other_units(recording, source.file)
    return recording, origin


def _standard(table: pl.DataFrame) -> pl.DataFrame:
    missing = [name for name in ("vx", "vy", "speed", "heading", "length", "width") if name not in table.columns]
    table = table.with_columns(pl.lit(None, pl.Float64).alias(name) for name in missing)
    if "kind" not in table.columns:
        table = table.with_columns(kind=pl.lit(int(AgentKind.CAR), pl.Int8))
    return table


def _readable(table: pl.DataFrame) -> pl.Expr:
    optional = [
        pl.col(name).is_finite().fill_null(False)
        for name in ("vx", "vy", "speed", "heading")
        if table[name].null_count() < table.height
    ]
    places = [pl.col(name).is_finite().fill_null(False) for name in ("x", "y")]
    there = [pl.col(name).is_not_null() for name in ("agent", "frame", "kind")]
    sizes = [pl.col(name).is_finite().fill_null(True) for name in ("length", "width")]
    turned = (pl.col("heading").abs() <= MAX_ANGLE_RAD).fill_null(True)
    return pl.all_horizontal(*there, *places, *optional, *sizes, turned)


def _plausible(table: pl.DataFrame, origin_m: Float64[np.ndarray, " 2"]) -> pl.Expr:
    near = [(pl.col(name) - o).abs() <= MAX_DISTANCE_M for name, o in zip(("x", "y"), origin_m.tolist(), strict=True)]
    speed = (pl.col("vx").pow(2) + pl.col("vy").pow(2)).fill_null(0.0) <= MAX_SPEED_MPS**2
    speed &= pl.col("speed").fill_null(0.0).abs() <= MAX_SPEED_MPS
    # 0 stands for "not known" in several formats (inD: people and bicycles).
    sized = [
        (pl.col(name).fill_null(0.0) == 0.0) | pl.col(name).is_between(MIN_SIDE_M, most)
        for name, most in (("length", MAX_LENGTH_M), ("width", MAX_WIDTH_M))
    ]
    return pl.all_horizontal(*near, speed, *sized, pl.col("frame").is_between(0, MAX_FRAME))


def _kept(table: pl.DataFrame, condition: pl.Expr, reason: str, dropped: dict[str, int]) -> pl.DataFrame:
    kept = table.filter(condition)
    dropped[reason] = dropped.get(reason, 0) + table.height - kept.height
    return kept


def _once(ordered: pl.DataFrame) -> pl.DataFrame:
    """The first row of each agent in each frame."""
    agent, frame = ordered["agent"], ordered["frame"]
    again = ((agent == agent.shift()) & (frame == frame.shift())).fill_null(False)
    return ordered.filter(~again) if again.any() else ordered


def _numbers(table: pl.DataFrame, *names: str) -> Float64[np.ndarray, "row _"]:
    """Columns beside one another; a missing number is NaN."""
    return np.stack([table[name].to_numpy().astype(np.float64) for name in names], axis=1)


def _origin(table: pl.DataFrame) -> Float64[np.ndarray, " 2"]:
    """Near the first road users: what comes later moves nothing."""
    first = table.sort("frame", maintain_order=True).head(ORIGIN_ROWS)
    return np.asarray(np.round(np.median(_numbers(first, "x", "y"), axis=0), -2)) + 0.0  # no -0.0


def _lost(dropped: dict[str, int]) -> str:
    lost = ", ".join(f"{n} {reason}" for reason, n in dropped.items() if n)
    return f": {lost}" if lost else ""


def _derived(
    table: pl.DataFrame, source: Source, signals: SignalLog | None, dropped: dict[str, int], *, front: bool
) -> Recording:
    names, agent = np.unique(table["agent"].to_numpy(), return_inverse=True)
    agent, frame = agent.astype(np.int64), table["frame"].to_numpy().astype(np.int64)
    position = _numbers(table, "x", "y")
    velocity, heading, ahead = _motion(table, agent, frame, position, source.dt_s)
    first = np.searchsorted(agent, np.arange(len(names)))  # what is known when it appears
    kind = table["kind"].to_numpy()[first].astype(np.int8)
    size, guessed = completed(_numbers(table, "length", "width")[first], kind)
    keep = np.isfinite(velocity).all(axis=1)
    dropped["velocity_unknown"] = int((~keep).sum())
    motor = np.isin(kind, _MOTOR)
    aimless = keep & ~np.isfinite(heading)
    still = aimless & ~motor[agent]  # a person who stands has no direction: along +x, in a square
    heading[still], ahead[still] = 0.0, np.where(ahead[still] >= NEVER, 0, ahead[still])
    keep &= np.isfinite(heading)
    dropped["heading_unknown"] = int((aimless & motor[agent]).sum())
    if front:
        position = position - size[agent, :1] / 2 * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    seen, row_agent = np.unique(agent[keep], return_inverse=True)
    return Recording(
        recording_id=source.recording_id,
        agent_id=tuple(str(names[i]) for i in seen),
        kind=kind[seen],
        size_m=size[seen].astype(np.float32),
        agent=row_agent.astype(np.int64),
        frame=frame[keep],
        position_m=position[keep],
        velocity_mps=velocity[keep],
        heading_rad=wrap_angle(heading[keep]),
        lookahead=ahead[keep],
        dt_s=source.dt_s,
        signals=signals,
        dropped=dropped,
        notes={"tracks": len(seen), "tracks_size_by_kind": int(guessed[seen].sum())},
    )


def _motion(
    table: pl.DataFrame,
    agent: Int64[np.ndarray, " row"],
    frame: Int64[np.ndarray, " row"],
    position: Float64[np.ndarray, "row 2"],
    dt_s: float,
) -> tuple[Float64[np.ndarray, "row 2"], Float64[np.ndarray, " row"], Int64[np.ndarray, " row"]]:
    velocity = _numbers(table, "vx", "vy")
    heading = table["heading"].to_numpy().astype(np.float64)
    ahead = np.zeros(len(agent), np.int64)
    speed = table["speed"].to_numpy().astype(np.float64)
    along = not np.isfinite(velocity).any() and np.isfinite(speed).any()
    if not along and not np.isfinite(velocity).any():
        velocity, ahead = backward_velocity(agent, frame, position, dt_s)
    if not np.isfinite(heading).any():
        heading, later = courses(agent, frame, position)
        ahead = np.maximum(ahead, np.where(np.isfinite(heading), later, 0))
    if along:  # what never moves has no heading, and a speed of nothing but noise
        direction = np.stack([np.cos(heading), np.sin(heading)], axis=1)
        velocity = np.where(np.isfinite(heading)[:, None], speed[:, None] * direction, 0.0)
    return velocity, heading, ahead
