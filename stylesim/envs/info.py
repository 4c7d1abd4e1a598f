"""The `info` of a step: what happened, and the truth about the neighbours that are seen."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Int64

from stylesim.envs.world import DECISIONS, Snapshot
from stylesim.style import STYLE_CLASSES


def described(snapshot: Snapshot, rows: Int64[np.ndarray, " neighbour"], places: int) -> dict[str, Any]:
    """`info` without reward and cost; the arrays in "neighbours" are in the order of the observation's rows.

    They always have `places` entries (so that vector environments can stack them); an empty place has number -1.
    """
    ego = snapshot.ego
    free = places - len(rows)

    def filled(values: np.ndarray, empty: float) -> np.ndarray:
        return np.concatenate([values[rows], np.full(free, empty, values.dtype)])

    styles = [STYLE_CLASSES[i] if i >= 0 else "" for i in snapshot.style[rows]]
    return {
        "time_s": ego.time_s,
        "speed_mps": ego.speed_mps,
        "acceleration_mps2": ego.acceleration_mps2,
        "crashed": bool(ego.collided),
        "ran_red": bool(ego.reds_run),
        "arrived": bool(ego.arrived),
        "vehicles": len(snapshot.number) - 1,
        "neighbours": {
            "number": filled(snapshot.number, -1.0),
            "style": (*styles, *("",) * free),
            "aggressiveness": filled(snapshot.knob, 0.0),
            "decision": (*(DECISIONS[i] for i in snapshot.decision[rows]), *("",) * free),
            "ran_red": filled(snapshot.ran_red, 0.0),
            "crashed": filled(snapshot.crashed, 0.0),
        },
    }
