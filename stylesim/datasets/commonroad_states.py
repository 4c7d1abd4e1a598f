"""The states of CommonRoad's trajectories, read from the text: nine tenths of a scenario's XML are these.

A trajectory whose every state is in the common form (exact values, one point), with nothing but white space between, is
read by a regular expression; any other, and a document with comments or CDATA, is left to the XML parser, which judges
the rest of the document.
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
_ANY_ORDER = re.compile(rb"\s*<state>\s*(?:(?:" + rb"|".join(_FIELDS) + rb")\s*)+</state>")
# The order of most files; three times as fast.
_USUAL_ORDER = re.compile(rb"\s*<state>\s*" + rb"\s*".join(_FIELDS[:4]) + rb"\s*(?:" + _FIELDS[4] + rb"\s*)*</state>")
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
    rows = _rows(_USUAL_ORDER, text) or _rows(_ANY_ORDER, text)
    if rows is None:
        return None
    states = []
    for x, y, heading, time, speed in rows:
        if not (x and heading and time) or not time.isdigit():
            return None
        states.append((int(time), float(x), float(y), float(heading), float(speed or 0)))
    return states


def _rows(pattern: re.Pattern[bytes], text: bytes) -> list[tuple[bytes, ...]] | None:
    """The groups of each state; None where something that is no such state stands before, between or behind them."""
    found, end = [], 0
    while (match := pattern.match(text, end)) is not None:
        found.append(match.groups())
        end = match.end()
    return found if found and not text[end:].strip() else None
