"""Collisions as the logged boxes show them, and whose doing they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from stylesim.geometry import box_corners, wrap_angle
from stylesim.overlaps import overlaps
from stylesim.scene import Scene
from stylesim.tracks import TrackFlag, Tracks

SAME_WAY_RAD = np.deg2rad(45.0)  # as for neighbours (REFERENCE section 1)
BEHIND_SHARE = 0.8  # chosen: centres further apart than this share of the half lengths touch bumper to bumper
LOOK_BACK_S = 1.0  # chosen: who moved over within the last second
FRONT_SHARE = 0.5  # chosen: a contact in the foremost quarter of a car's length is at its front

STANDING_MPS = 0.5  # chosen: who rolls so slowly was run into

RAN_RED, REAR_END, SIDEWAYS = "ran red", "rear end", "sideways"
INTO_SIDE, INTO_STANDING, UNDECIDED = "front into side", "into one that stands", "undecided"


@dataclass(frozen=True)
class Collision:
    """Two agents (places in the scene) whose boxes first overlap at `frame`.

    `charged` are those whose doing it is: driving the same way, the one behind, or the one that moved over; crossing,
    the one that ran a red light, whose front hit the other's side, or who ran into one that stands. Both where that
    does not decide it.
    `under_stressor`: one of them did or met something unusual on purpose (a stressor of the episode) before.
    """

    first: int
    second: int
    frame: int
    how: str
    charged: tuple[int, ...]
    under_stressor: bool = False


def collisions_of(scene: Scene) -> tuple[list[Collision], int]:
    """Every pair of road users whose boxes come to overlap, by time; and how many pairs overlapped when first seen.

    The latter (put onto each other by a source, not driven) are not collisions. Boxes of unknown size take no part.
    """
    tracks = scene.tracks
    sized = np.isfinite(tracks.size_m).all(axis=1)
    agent, frame = np.nonzero(tracks.valid & sized[:, None])
    found = overlaps(
        frame, agent, tracks.position_m[agent, frame], tracks.heading_rad[agent, frame], tracks.size_m[agent]
    )
    stress_from = _stress_from(scene)
    begin = np.where(tracks.valid.any(axis=1), tracks.valid.argmax(axis=1), 0)
    result, at_first_sight, known = [], 0, set()
    for when, a, b in found[np.argsort(found[:, 0], kind="stable")].tolist():
        pair = (min(a, b), max(a, b))
        if pair in known:
            continue
        known.add(pair)
        if when <= max(begin[a], begin[b]):
            at_first_sight += 1
        else:
            stressed = any(stress_from.get(tracks.agent_id[i], np.inf) <= when * tracks.dt_s for i in pair)
            result.append(Collision(*pair, when, *_attributed(tracks, *pair, when), stressed))
    return result, at_first_sight


def _stress_from(scene: Scene) -> dict[str, float]:
    """Since when (s) each agent takes part in a stressor, from the scene's events."""
    found: dict[str, float] = {}
    for event in scene.metadata.get("events", ()):
        for name in (event["actor"], event["victim"]):
            if name:
                found[name] = min(found.get(name, np.inf), float(event["time_s"]))
    return found


def _attributed(tracks: Tracks, a: int, b: int, frame: int) -> tuple[str, tuple[int, ...]]:
    """How they met, and who is charged."""
    turn = abs(float(wrap_angle(np.asarray(tracks.heading_rad[b, frame] - tracks.heading_rad[a, frame], np.float64))))
    if turn < SAME_WAY_RAD:
        return _same_way(tracks, a, b, frame)
    red = tracks.flagged(TrackFlag.RAN_RED)  # at any light of the trip: the flag has no time
    if red[a] != red[b]:
        return RAN_RED, (a if red[a] else b,)
    reach = [_contact_ahead(tracks, one, other, frame) for one, other in ((a, b), (b, a))]
    at_front = [share >= FRONT_SHARE for share in reach]
    if at_front[0] != at_front[1]:
        return INTO_SIDE, (a if at_front[0] else b,)
    stands = tracks.speed_mps[[a, b], frame] < STANDING_MPS
    if stands[0] != stands[1]:
        return INTO_STANDING, (b if stands[0] else a,)
    return UNDECIDED, (a, b)


def _same_way(tracks: Tracks, a: int, b: int, frame: int) -> tuple[str, tuple[int, ...]]:
    heading = float(tracks.heading_rad[a, frame])
    ahead, left = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
    apart = (tracks.position_m[b, frame] - tracks.position_m[a, frame]).astype(np.float64)
    half = float(tracks.size_m[[a, b], 0].sum()) / 2
    if abs(apart @ ahead) >= BEHIND_SHARE * half:
        return REAR_END, (a if apart @ ahead > 0 else b,)
    back = max(0, frame - max(1, round(LOOK_BACK_S / tracks.dt_s)))
    toward = float(np.sign(apart @ left))
    over = []
    for one, sign in ((a, toward), (b, -toward)):
        moved = (tracks.position_m[one, frame] - tracks.position_m[one, back]).astype(np.float64)
        over.append(sign * float(np.nan_to_num(moved @ left)))
    if over[0] == over[1]:
        return UNDECIDED, (a, b)
    return SIDEWAYS, (a if over[0] > over[1] else b,)


def _contact_ahead(tracks: Tracks, one: int, other: int, frame: int) -> float:
    """Where along `one` the contact is: 1 at its front bumper, -1 at its rear."""
    pair = [one, other]
    centre, heading = tracks.position_m[pair, frame].astype(np.float64), tracks.heading_rad[pair, frame]
    size = tracks.size_m[pair].astype(np.float64)
    corners = box_corners(centre, heading.astype(np.float64), size)
    inside = []
    for box, points in ((0, corners[1]), (1, corners[0])):
        local = _in_frame(points, centre[box], float(heading[box]))
        inside.append(points[(np.abs(local) <= size[box] / 2).all(axis=1)])
    touched = np.concatenate(inside)
    place = touched.mean(axis=0) if len(touched) else centre.mean(axis=0)
    return float(_in_frame(place[None], centre[0], float(heading[0]))[0, 0] / (size[0, 0] / 2))


def _in_frame(
    points: Float64[np.ndarray, "point 2"], centre: Float64[np.ndarray, " 2"], heading: float
) -> Float64[np.ndarray, "point 2"]:
    """Points seen from a box: ahead and to the left of its centre."""
    away = points - centre
    c, s = np.cos(heading), np.sin(heading)
    return np.stack([away[:, 0] * c + away[:, 1] * s, away[:, 1] * c - away[:, 0] * s], axis=1)
