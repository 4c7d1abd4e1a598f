"""What is logged is where SUMO itself says the vehicles are: held against the floating-car data of the bare program."""

from __future__ import annotations

import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from stylesim.population import Population
from stylesim.scenario import load_scenario

pytest.importorskip("libsumo")
from stylesim.simulation.sumo.episode import DT_S, prepare_episode, sumo_options
from stylesim.simulation.sumo.runner import SumoBackend

PROGRAM = shutil.which("sumo") or str(Path(sys.executable).with_name("sumo"))


def test_the_log_of_a_scenario_without_signals_equals_sumos_own_output(tmp_path):
    scenario = load_scenario("ramp_merge").model_copy(update={"duration_s": 20.0, "warm_up_s": 10.0})
    files = prepare_episode(scenario, Population.load("tdbm_spectrum"), seed=3, episode=1, folder=tmp_path)
    fcd = tmp_path / "fcd.xml"
    more = ["--fcd-output", str(fcd), "--precision", "6"]
    subprocess.run([PROGRAM, *sumo_options(files), *more], check=True, capture_output=True)
    theirs = {
        (vehicle.attrib["id"], round(float(step.attrib["time"]) / DT_S)): (
            float(vehicle.attrib["x"]),
            float(vehicle.attrib["y"]),
        )
        for step in ET.parse(fcd).getroot()
        for vehicle in step
    }
    backend = SumoBackend()
    log, _ = backend.simulate(files)
    backend.close()
    keys = [(log.driver_ids[d], int(s)) for d, s in zip(log.driver, log.step, strict=True)]
    shared = [i for i, key in enumerate(keys) if key in theirs]
    assert len(shared) > 2000
    assert len(shared) > 0.99 * len(keys)
    want = np.array([theirs[keys[i]] for i in shared])
    np.testing.assert_allclose(log.front_m[shared], want, atol=2e-6)
