"""A counterfactual twin in SUMO: one driver becomes another person while it drives.

A driver's vehicle type is what it is; EIDM reads some of it only when it is made. So the vehicle gets a second type
(written beside the first by `demand.routes_xml`). SUMO copies lane-change attributes and the speed factor of a type to
the vehicle when that is made: `setType` leaves them, so they are set one by one. EIDM starts anew with the type.
"""

from __future__ import annotations

from dataclasses import replace

from stylesim.simulation.sumo.engine import SumoApi
from stylesim.simulation.sumo.episode import TWIN_TYPE, EpisodeFiles
from stylesim.simulation.sumo.vehicles import type_attributes
from stylesim.simulation.sumo.yellow import YellowController


class StyleSwitch:
    """Makes the twin's driver another one at its moment; call `before_step` ahead of every simulation step."""

    def __init__(self, sumo: SumoApi, files: EpisodeFiles, yellow: YellowController) -> None:
        self._sumo, self._files, self._yellow = sumo, files, yellow

    def before_step(self, step: int) -> None:
        """Switches in the first step whose frame may differ; nothing happens where the driver is not on the road."""
        if step != self._files.switch_step:
            return
        twin, vehicle = self._files.twin, self._sumo.vehicle
        assert twin is not None
        if twin.new_noise or twin.driver not in vehicle.getIDList():
            return
        driver = replace(self._files.drivers[twin.driver], style=twin.style, type_suffix=TWIN_TYPE)
        attributes = type_attributes(driver)
        vehicle.setType(twin.driver, driver.type_id)
        vehicle.setSpeedFactor(twin.driver, float(attributes["speedFactor"]))
        for name, value in attributes.items():
            if name.startswith("lc"):
                vehicle.setParameter(twin.driver, f"laneChangeModel.{name}", value)
        self._files.now[twin.driver] = driver
        self._yellow.tell_again(twin.driver)
