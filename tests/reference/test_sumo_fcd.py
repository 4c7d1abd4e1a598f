"""What is logged is where SUMO itself says the vehicles are: held against its own floating-car data."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from stylesim.population import Population
from stylesim.scenario import load_scenario

pytest.importorskip("libsumo")
from stylesim.simulation.sumo import runner
from stylesim.simulation.sumo.episode import DT_S, prepare_episode


def test_the_log_of_a_scenario_without_signals_equals_sumos_own_output(tmp_path, monkeypatch):
    """SUMO writes its floating-car data in the very run that is logged: drivers who look around steer that run."""
    scenario = load_scenario("ramp_merge").model_copy(update={"duration_s": 40.0, "warm_up_s": 10.0})
    files = prepare_episode(scenario, Population.load("tdbm_spectrum"), seed=3, episode=1, folder=tmp_path)
    fcd = tmp_path / "fcd.xml"
    plain = runner.sumo_options
    more = ["--fcd-output", str(fcd), "--precision", "6"]
    monkeypatch.setattr(runner, "sumo_options", lambda episode: [*plain(episode), *more])
    backend = runner.SumoBackend()
    log, _ = backend.simulate(files)
    backend.close()
    theirs = {
        (vehicle.attrib["id"], round(float(step.attrib["time"]) / DT_S)): (
            float(vehicle.attrib["x"]),
            float(vehicle.attrib["y"]),
        )
        for step in ET.parse(fcd).getroot()
        for vehicle in step
    }
    keys = [(log.driver_ids[d], int(s)) for d, s in zip(log.driver, log.step, strict=True)]
    shared = [i for i, key in enumerate(keys) if key in theirs]
    assert len(shared) > 2000
    assert len(shared) > 0.99 * len(keys)
    want = np.array([theirs[keys[i]] for i in shared])
    np.testing.assert_allclose(log.front_m[shared], want, atol=2e-6)
