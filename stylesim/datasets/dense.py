"""Arrays by agent and frame into `Tracks`: what cannot be a road user is dropped and counted, the rest is flagged."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int

from stylesim.datasets.flagging import flagged_implausible
from stylesim.datasets.plausible import (
    MAX_DISTANCE_M,
    MAX_LENGTH_M,
    MAX_SPEED_MPS,
    MAX_WIDTH_M,
    MIN_ROWS,
    MIN_SIDE_M,
    MOVING_MPS,
    SPEED_RATIO,
)
from stylesim.errors import InputError
from stylesim.geometry import wrap_angle
from stylesim.tracks import AgentKind, Tracks

MAX_COORDINATE_M = 1e8  # chosen: more than once round the earth is no coordinate in metres
MAX_LOST_SHARE = 0.5  # chosen: a file that loses more of its rows than this is of other units, or damaged as a whole
CAR_LENGTH_M = (2.5, 8.0)  # the median of a site's cars is 4 to 5 m; feet would give 15, decimetres 45, metres/feet 1.4
MIN_CARS = 5  # chosen: fewer cars do not prove that a unit is wrong
MAX_HEADING_ERROR_RAD = 0.6  # chosen: degrees, or a clockwise angle, give medians about 1.5


def checked_tracks(
    *,
    agent_id: Sequence[str],
    kind: Int[np.ndarray, " agent"],
    size_m: Float[np.ndarray, "agent 2"],
    position_m: Float[np.ndarray, "agent time 2"],
    velocity_mps: Float[np.ndarray, "agent time 2"],
    heading_rad: Float[np.ndarray, "agent time"],
    valid: Bool[np.ndarray, "agent time"],
    dt_s: float,
    origin_m: Float[np.ndarray, " 2"],
    file: Path,
    flags: Int[np.ndarray, " agent"] | None = None,
    lookahead_steps: Int[np.ndarray, "agent time"] | None = None,
) -> tuple[Tracks, dict[str, int]]:
    """The tracks in metres from `origin_m`, and how many rows (valid agent-frames) were dropped for which reason.

    `position_m` is in the source's frame. Dropped: `unreadable` (a number is not finite), `implausible` (faster
    than MAX_SPEED_MPS, larger than a road train, or farther than MAX_DISTANCE_M away); agents without any row left
    vanish with their rows. InputError naming `file` where so much is wrong that it must be other units.
    """
    finite = np.isfinite(position_m).all(-1) & np.isfinite(velocity_mps).all(-1) & np.isfinite(heading_rad)
    finite &= np.isfinite(size_m).all(-1)[:, None] & (np.abs(heading_rad) < 1e4)  # a damaged float, no angle
    readable = valid & finite
    with np.errstate(invalid="ignore", over="ignore"):
        relative = position_m.astype(np.float64) - origin_m
        near = (np.abs(relative) <= MAX_DISTANCE_M).all(-1)
        speed = np.hypot(velocity_mps[..., 0].astype(np.float64), velocity_mps[..., 1].astype(np.float64))
        length, width = size_m[:, 0], size_m[:, 1]
        sized = (length >= MIN_SIDE_M) & (length <= MAX_LENGTH_M) & (width >= MIN_SIDE_M) & (width <= MAX_WIDTH_M)
    kept = readable & near & (speed <= MAX_SPEED_MPS) & sized[:, None]
    dropped = {"unreadable": int((valid & ~readable).sum()), "implausible": int((readable & ~kept).sum())}
    total = int(valid.sum())
    if sum(dropped.values()) > MAX_LOST_SHARE * total:
        raise InputError(
            f"{file}: {dropped['unreadable']} of {total} rows are not finite and {dropped['implausible']} cannot be "
            "road users in metres; it is damaged or in other units"
        )
    seen = kept.any(axis=1)
    hidden = ~kept[seen]
    tracks = Tracks(
        agent_id=tuple(name for name, there in zip(agent_id, seen, strict=True) if there),
        kind=np.asarray(kind)[seen].astype(np.int8),
        size_m=size_m[seen].astype(np.float32),
        position_m=_blanked(relative[seen], hidden),
        velocity_mps=_blanked(velocity_mps[seen], hidden),
        heading_rad=wrap_angle(_blanked(heading_rad[seen], hidden)),
        valid=kept[seen],
        dt_s=dt_s,
        origin_m=origin_m,
        flags=None if flags is None else np.asarray(flags, np.int32)[seen],
        lookahead_steps=None if lookahead_steps is None else lookahead_steps[seen].astype(np.int16),
    )
    refuse_other_units(tracks, file)
    return flagged_implausible(tracks), dropped


def _blanked(values: Float[np.ndarray, "agent time *any"], hidden: Bool[np.ndarray, "agent time"]) -> np.ndarray:
    result = np.array(values, np.float64)
    result[hidden] = np.nan
    return result.astype(np.float32)


def refuse_other_units(tracks: Tracks, file: Path) -> None:
    """InputError where velocities, headings or sizes cannot be in m/s, radians and metres as a whole."""
    cars = tracks.kind == AgentKind.CAR
    if cars.sum() >= MIN_CARS:
        length = float(np.median(tracks.size_m[cars, 0]))
        if not CAR_LENGTH_M[0] <= length <= CAR_LENGTH_M[1]:
            raise InputError(f"{file}: half of the cars are {length:.2f} m long or longer; lengths must be metres")
    both = tracks.valid[:, 1:] & tracks.valid[:, :-1] & tracks.is_motor[:, None]
    speed = tracks.speed_mps
    step = (np.diff(tracks.position_m.astype(np.float64), axis=1) / tracks.dt_s)[both]
    moved = np.hypot(step[:, 0], step[:, 1])
    meant = ((speed[:, 1:] + speed[:, :-1]) / 2)[both]
    with np.errstate(invalid="ignore"):
        moving = (meant > MOVING_MPS) | (moved > MOVING_MPS)
    if moving.sum() < MIN_ROWS:
        return
    ratio = float(np.median(moved[moving] / np.maximum(meant[moving], 1e-3)))
    if not SPEED_RATIO[0] <= ratio <= SPEED_RATIO[1]:
        raise InputError(
            f"{file}: positions move {ratio:.2f} times as fast as the velocities say; "
            f"positions must be metres, {tracks.dt_s:g} s apart, and velocities m/s"
        )
    course = np.arctan2(step[moving, 1], step[moving, 0])
    error = float(np.median(np.abs(wrap_angle(course - tracks.heading_rad[:, 1:][both][moving]))))
    if error > MAX_HEADING_ERROR_RAD:
        raise InputError(
            f"{file}: headings are {np.degrees(error):.0f} degrees off the direction of motion; "
            "they must be counter-clockwise from east"
        )


def origin_of(position_m: Float[np.ndarray, "agent time 2"], valid: Bool[np.ndarray, "agent time"]) -> np.ndarray:
    """A whole-metre point amid the agents of the first frame that has any: what comes later moves nothing."""
    there = valid & np.isfinite(position_m).all(-1) & (np.abs(position_m) < MAX_COORDINATE_M).all(-1)
    if not there.any():
        return np.zeros(2)
    first = int(there.any(axis=0).argmax())
    return np.round(np.median(position_m[there[:, first], first].astype(np.float64), axis=0))


def size_when_seen(
    size_m: Float[np.ndarray, "agent time 2"], valid: Bool[np.ndarray, "agent time"], t0: int
) -> np.ndarray:
    """One size per agent where the source measures it anew in each frame, not knowing what comes after t0.

    The median over the frames up to t0 in which it was seen; of an agent that appears later, its first one.
    """
    result = np.full((len(size_m), 2), np.nan)
    early = valid.copy()
    early[:, t0 + 1 :] = False
    for agent in range(len(size_m)):
        if early[agent].any():
            result[agent] = np.median(size_m[agent, early[agent]], axis=0)
        elif valid[agent].any():
            result[agent] = size_m[agent, int(valid[agent].argmax())]
    return result
