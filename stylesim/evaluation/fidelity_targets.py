"""What fidelity is held to, and where."""

from __future__ import annotations

from collections.abc import Mapping

from stylesim.evaluation.fidelity_agreement import Agreement

# Scenarios where drivers have slower neighbours and room to keep their wish: there a class can show in all features.
# Elsewhere v_nei is about 0, and the three aggressive classes own 0.2 % of what is left of the space [computed].
HELD_TO_TARGET = (
    "motorway", "ramp_merge", "lane_drop", "corridor", "yellow_light",
    "highway", "hw_merge", "hw_exit",
)  # fmt: skip
# Chosen as the project's goals: with 0.80, of five drivers that a user asked for four measure as asked; kappa and
# Spearman then say that the fifth is seldom far off. highway-env's short episodes hold one or two windows a driver.
BALANCED_ACCURACY: Mapping[str, float] = {"sumo": 0.80, "highway_env": 0.75}
KAPPA = 0.80
KNOB_TO_A = 0.85
CLASSES = 6
EXCLUDED_AT_MOST = 0.05
DRIVERS_PER_CLASS = 500


def backend_of(group: str) -> str:
    """The backend in a group's name ("sumo: motorway"); "" for all drivers together."""
    return group.partition(":")[0] if ":" in group else ""


def held(group: str) -> bool:
    """True for the groups that the targets are about."""
    name = group.partition(": ")[2]
    return name in HELD_TO_TARGET or name == "held to the target"


def targets_of(group: str) -> dict[str, float]:
    """The targets of that group's figures by name; empty where it is not held to any."""
    if not held(group):
        return {}
    accuracy = BALANCED_ACCURACY.get(backend_of(group))
    return {
        **({} if accuracy is None else {"balanced_accuracy": accuracy}),
        "kappa": KAPPA,
        "knob_to_a": KNOB_TO_A,
    }


def met(agreement: Agreement) -> bool | None:
    """True if every target of the group is reached by the point estimates; None where none applies."""
    wanted = targets_of(agreement.group)
    if not wanted:
        return None
    reached = [agreement.estimates[name].value >= least for name, least in wanted.items()]
    return bool(all(reached) and agreement.classes_present >= CLASSES)


def verdict(agreement: Agreement) -> str:
    """Whether the targets are met or missed, noting where a class has too few drivers; "" where none applies."""
    reached = met(agreement)
    if reached is None:
        return ""
    few = min(agreement.per_class) < DRIVERS_PER_CLASS
    return ("met" if reached else "missed") + (f", n < {DRIVERS_PER_CLASS} per class" if few else "")
