"""Vehicle types that a style needs and that cannot be made through SUMO's interface: EIDM with every pedal noise.

Neither the car-following model nor EIDM's error terms can be set while SUMO runs, but a type can be copied. So a file
loaded at the start holds one type for each step of pedal noise, and a driver's type is a copy of the nearest.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from stylesim.simulation.sumo.demand import type_xml
from stylesim.simulation.sumo.vehicles import EIDM_LARGEST_SIGMA, EIDM_NOISE_GAIN_MPS2, Driver
from stylesim.styles import style_table
from stylesim.tracks import AgentKind

PREFIX = "stylesim/pedal/"  # and the noise in mm/s2
STEP_MPS2 = 0.1  # chosen, because jerk does not differ visibly between neighbours of this grid


def _noise_mps2() -> list[float]:
    most = EIDM_LARGEST_SIGMA * EIDM_NOISE_GAIN_MPS2
    return [round(STEP_MPS2 * number, 3) for number in range(int(most / STEP_MPS2) + 2)]


def base_types_xml() -> list[str]:
    """The vType elements, one for each step of pedal noise, otherwise as the neutral driver's."""
    style = style_table("sumo").at(0.0)
    drivers = [
        Driver(
            f"{PREFIX}{round(1000 * noise)}", replace(style, pedal_noise_mps2=noise), AgentKind.CAR, 4.4, 1.8, 0.0, ""
        )
        for noise in _noise_mps2()
    ]
    return [type_xml(driver) for driver in drivers]


def nearest_base(noise_mps2: float, known: Iterable[str]) -> str:
    """The id among `known` types that carries the nearest pedal noise; "" where no such type is known."""
    bases = [name for name in known if name.startswith(PREFIX)]
    return min(bases, key=lambda name: abs(int(name.removeprefix(PREFIX)) / 1000 - noise_mps2), default="")
