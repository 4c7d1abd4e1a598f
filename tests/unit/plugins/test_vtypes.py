"""The file of vehicle types: schema, shares, and that plain `sumo` drives with it."""

from __future__ import annotations

import os
import subprocess
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

import pytest

from stylesim.errors import InputError
from stylesim.plugins.base_types import PREFIX, nearest_base
from stylesim.plugins.vtypes import distribution_id, export_vtypes
from stylesim.population import Population
from stylesim.simulation.sumo.network import sumo_program
from tests.unit.plugins.own_sumo import write_network

XSI = 'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="http://sumo.dlr.de/xsd/routes_file.xsd"'


def plain_sumo(folder: Path, types: Path) -> subprocess.CompletedProcess[str]:
    """Run the program with the file, its schema validation on."""
    sumo = sumo_program("sumo")
    command = [str(sumo), "-n", "crossing.net.xml", "-a", str(types), "-r", "flow.rou.xml", "--step-length", "0.1"]
    command += ["--lanechange.duration", "4.5", "--end", "120", "--vehroute-output", "routes.out.xml", "--no-step-log"]
    command += ["--vehroute-output.write-unfinished", "--xml-validation", "always", "--xml-validation.net", "never"]
    environment = {**os.environ, "SUMO_HOME": str(sumo.parent.parent)}  # where the schemas are
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, env=environment)


def test_plain_sumo_drives_with_the_file_and_its_schema(tmp_path: Path) -> None:
    write_network(tmp_path)
    types = export_vtypes("rare_heavy", tmp_path / "styles.add.xml", truck_share=0.1)
    flow = '<flow id="f" type="stylesim.rare_heavy" from="wc" to="ce" begin="0" end="120" vehsPerHour="1800"/>'
    (tmp_path / "flow.rou.xml").write_text(f"<routes {XSI}>{flow}</routes>")
    done = plain_sumo(tmp_path, types)
    assert done.returncode == 0, done.stderr
    assert "Error" not in done.stderr
    assert "Warning" not in done.stderr
    used = ET.parse(tmp_path / "routes.out.xml").getroot().findall("vehicle")
    classes = Counter(vehicle.attrib["type"].split(".")[1] for vehicle in used)
    assert sum(classes.values()) >= 40
    assert len(classes) >= 5

    types.write_text(types.read_text().replace("sigmaerror", "sigmaerrror", 1))
    refused = plain_sumo(tmp_path, types)
    assert refused.returncode != 0
    assert "sigmaerrror" in refused.stderr


def test_probabilities_of_each_class_sum_to_its_share(tmp_path: Path) -> None:
    crowd = Population.of(aggressive=0.25, timid=0.75)
    root = ET.parse(export_vtypes(crowd, tmp_path / "f.xml", types=40)).getroot()
    rows = root.findall("vTypeDistribution/vType")
    total: Counter[str] = Counter()
    for row in rows:
        total[row.attrib["id"].split(".")[1]] += float(row.attrib["probability"])
    assert dict(total) == {"aggressive": pytest.approx(0.25, abs=1e-6), "timid": pytest.approx(0.75, abs=1e-6)}
    assert len(rows) == 40
    headways = {name: [float(r.attrib["tau"]) for r in rows if name in r.attrib["id"]] for name in total}
    assert max(headways["aggressive"]) < min(headways["timid"])
    assert len(set(headways["timid"])) > 20  # drivers of a class differ


def test_the_file_says_what_it_cannot_carry_and_is_the_same_again(tmp_path: Path) -> None:
    first, second = (export_vtypes("naturalistic", tmp_path / name, seed=3).read_bytes() for name in ("a", "b"))
    assert first == second
    assert export_vtypes("naturalistic", tmp_path / "c", seed=4).read_bytes() != first
    assert b"What a file alone cannot carry" in first
    assert b"yellow" in first


def test_base_types_cover_the_pedal_noise(tmp_path: Path) -> None:
    root = ET.parse(export_vtypes("neutral", tmp_path / "f.xml")).getroot()
    bases = [row.attrib["id"] for row in root.findall("vType")]
    assert nearest_base(0.0, bases) == f"{PREFIX}0"
    assert nearest_base(0.26, bases) == f"{PREFIX}300"
    assert nearest_base(9.0, bases) == bases[-1]
    assert nearest_base(0.3, ["car"]) == ""
    sigma = [float(row.attrib["sigmaerror"]) for row in root.findall("vType")]
    assert sigma == sorted(sigma)
    assert sigma[-1] == 0.5


def test_ids_are_what_sumo_takes() -> None:
    assert distribution_id(Population.load("rare_heavy")) == "stylesim.rare_heavy"
    assert distribution_id(Population.of(aggressive=0.3, timid=0.7)) == "stylesim.aggressive=0.3_timid=0.7"


def test_bad_input(tmp_path: Path) -> None:
    (tmp_path / "there").write_text("mine")
    for arguments, words in (
        ({"out": tmp_path / "there"}, "there already"),
        ({"out": tmp_path / "no" / "f.xml"}, "no such folder"),
        ({"out": tmp_path / "f.xml", "types": 3}, "at least 6"),
        ({"out": tmp_path / "f.xml", "truck_share": 1.5}, "truck_share"),
    ):
        with pytest.raises(InputError, match=words):
            export_vtypes("naturalistic", **arguments)
    with pytest.raises(InputError, match="'naturalistic'"):
        export_vtypes("naturalstic", tmp_path / "f.xml")
    assert (tmp_path / "there").read_text() == "mine"
    assert not (tmp_path / "f.xml").exists()
