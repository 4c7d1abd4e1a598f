"""The states of CommonRoad's trajectories, read from the text: nine tenths of a scenario's XML are these.

The document was checked by the XML parser before. A trajectory whose every state is in the common form (exact values,
one point) is read by one regular expression; any other, and a document with comments or CDATA, is left to the tree.
"""

from __future__ import annotations

import re

_NUMBER = rb"\s*([^<\s]+)\s*"
_EXACT = rb"<exact>" + _NUMBER + rb"</exact>\s*"
_FIELDS = (
    rb"<position>\s*<point>\s*<x>" + _NUMBER + rb"</x>\s*<y>" + _NUMBER + rb"</y>\s*(?:<z>[^<]*</z>\s*)?</point>\s*"
    rb"</position>",
    rb"<orientation>\s*" + _EXACT + rb"</orientation>",
    rb"<time>\s*" + _EXACT + rb"</time>",
    rb"<velocity>\s*" + _EXACT + rb"</velocity>",
    rb"<(?:acceleration|velocityY|accelerationY|yawRate|slipAngle|steeringAngle|jerk)>\s*<exact>[^<]*</exact>\s*"
    rb"</(?:acceleration|velocityY|accelerationY|yawRate|slipAngle|steeringAngle|jerk)>",
)
_STATE = re.compile(rb"<state>\s*(?:(?:" + rb"|".join(_FIELDS) + rb")\s*)+</state>")
_BEGIN, _END = b"<trajectory>", b"</trajectory>"

State = tuple[int, float, float, float, float]  # step, x, y, orientation, speed


def without_trajectories(raw: bytes) -> tuple[bytes, list[list[State]]]:
    """The document with each trajectory that can be read replaced by <trajectory states="k"/>, and their states.

    k is the index in the list. ValueError where a number of a state is none.
    """
    if b"<!--" in raw or b"<![CDATA[" in raw or b"<trajectory " in raw:
        return raw, []
    found: list[list[State]] = []
    kept, done = [], 0
    while (start := raw.find(_BEGIN, done)) >= 0 and (end := raw.find(_END, start)) >= 0:
        states = _states(raw[start + len(_BEGIN) : end])
        kept.append(raw[done:start])
        if states is None:
            kept.append(raw[start : end + len(_END)])
        else:
            kept.append(b'<trajectory states="%d"/>' % len(found))
            found.append(states)
        done = end + len(_END)
    return b"".join([*kept, raw[done:]]), found


def _states(text: bytes) -> list[State] | None:
    """All states of a trajectory; None unless each is in the common form, with every value that is needed."""
    rows = _STATE.findall(text)
    if len(rows) != text.count(b"<state"):
        return None
    states = []
    for x, y, heading, time, speed in rows:
        if not (x and heading and time) or not time.isdigit():
            return None
        states.append((int(time), float(x), float(y), float(heading), float(speed or 0)))
    return states
