"""What the features of driving style are measured with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from stylesim.errors import InputError, unknown
from stylesim.kinematics import Smoother

NEIGHBOUR_KINDS = ("motor", "all")


@dataclass(frozen=True)
class FeatureOptions:
    """Every choice in the definitions of REFERENCE section 1; the defaults are its [ours] values.

    `neighbours` "motor": motor vehicles that drive the same way and are not parked; "all": every other road user
    of the scene within the radius.
    """

    smoother: Smoother = field(default_factory=Smoother)
    window_s: float = 11.0  # of track labels and their scaler
    mu_per_s: float = 1.0  # weight of being off-centre against moving sideways, in s_center
    lane_change_s: float = 2.0  # s_center is 0 this long before and after a lane change
    radius_m: float = 100.0
    distance_floor_m: float = 1.0
    neighbours: str = "motor"
    neighbour_heading_deg: float = 45.0
    parked_within_m: float = 1.0  # who moves less in the window is parked
    leader_range_m: float = 100.0

    def __post_init__(self) -> None:
        """Refuse unknown kinds of neighbours and numbers that mean nothing."""
        if self.neighbours not in NEIGHBOUR_KINDS:
            raise unknown("kind of neighbours", self.neighbours, NEIGHBOUR_KINDS)
        for name in ("window_s", "radius_m", "distance_floor_m", "neighbour_heading_deg", "leader_range_m"):
            if not getattr(self, name) > 0:
                raise InputError(f"{name} must be positive, not {getattr(self, name)}")
        for name in ("mu_per_s", "lane_change_s", "parked_within_m"):
            if not getattr(self, name) >= 0:
                raise InputError(f"{name} must not be negative, not {getattr(self, name)}")

    def to_dict(self) -> dict[str, Any]:
        """As JSON-able values."""
        return asdict(self)

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> FeatureOptions:
        """From what `to_dict` gave; InputError for an unknown key."""
        known = set(cls.__dataclass_fields__)
        for key in raw:
            if key not in known:
                raise unknown("feature option", key, known)
        values = dict(raw)
        if "smoother" in values:
            values["smoother"] = Smoother(**values["smoother"])
        return cls(**values)
