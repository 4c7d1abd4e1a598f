"""The conditions that `train` knows: what is told of a driver, in which form, and from which part of his track.

No torch.
"""

from __future__ import annotations

from dataclasses import dataclass

from stylesim.errors import unknown

SEES_FUTURE = "sees the future"  # the mark of everything that the oracle touches
EARLIER_S = 20.0  # seconds before the history that "earlier" looks at; chosen: four more windows of 5 s


@dataclass(frozen=True)
class Condition:
    """`method` gives the classes; `form` is what the network is given of it; `span` says where it comes from.

    Forms: "cells" (style, cluster, context), "scores" (scores or probabilities of the classes), "features" (raw
    features of TDBM and KDSC), "random" (a cell drawn for each driver). Spans: "history"; "earlier" (the history and
    the windows before it); "truth" (the commanded style, else the class of the whole track).
    """

    method: str
    form: str = "cells"
    span: str = "history"

    @property
    def sees_future(self) -> bool:
        """True for the oracle: for benchmarks only."""
        return self.span == "truth"


TABLE: dict[str, Condition] = {
    "tdbm": Condition("tdbm"),
    "kdsc": Condition("kdsc"),
    "tdbm_scores": Condition("tdbm", form="scores"),
    "kdsc_probabilities": Condition("kdsc", form="scores"),
    "features": Condition("tdbm", form="features"),
    "random": Condition("tdbm", form="random"),
    "earlier": Condition("tdbm", span="earlier"),
    "earlier_features": Condition("tdbm", form="features", span="earlier"),
    "oracle": Condition("tdbm", span="truth"),
}
NO_CONDITION = "none"
CONDITIONS = (NO_CONDITION, *TABLE)


def condition_of(name: str) -> Condition:
    """The condition of that name (not "none"); InputError for an unknown one."""
    if name not in TABLE:
        raise unknown("condition", name, CONDITIONS)
    return TABLE[name]


def model_name(size: str, condition: str, fusion: str) -> str:
    """What a trained model is called in reports; an oracle says that it is one."""
    if condition == NO_CONDITION:
        return size
    mark = f" ({SEES_FUTURE})" if condition_of(condition).sees_future else ""
    return f"{size}-{condition}-{fusion}{mark}"
