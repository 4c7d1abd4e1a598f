"""Overlaps of logged boxes."""

from __future__ import annotations

import numpy as np

from stylesim.geometry import box_corners, boxes_overlap
from stylesim.overlaps import overlaps


def test_equals_looking_at_every_pair() -> None:
    rng = np.random.default_rng(0)
    frames, agents = 6, 25
    frame, agent = np.repeat(np.arange(frames), agents), np.tile(np.arange(agents), frames)
    position = rng.uniform(0, 40, (len(frame), 2))
    heading = rng.uniform(-3, 3, len(frame))
    size = np.stack([rng.uniform(3, 12, len(frame)), rng.uniform(1.5, 2.5, len(frame))], axis=1)
    corners = box_corners(position, heading, size)
    expected = {
        (int(frame[i]), *sorted((int(agent[i]), int(agent[j]))))
        for i in range(len(frame))
        for j in range(i)
        if frame[i] == frame[j] and boxes_overlap(corners[i], corners[j])
    }
    found = overlaps(frame, agent, position, heading, size)
    assert expected
    assert {(int(f), *sorted((int(a), int(b)))) for f, a, b in found} == expected
    assert len(found) == len(expected)


def test_nobody_overlaps_alone() -> None:
    one = np.zeros(1, np.int64)
    assert overlaps(one, one, np.zeros((1, 2)), np.zeros(1), np.ones((1, 2))).shape == (0, 3)
