"""`populate` in a user's own simulation: by libsumo in this process, by TraCI with the `sumo` program."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stylesim as ss
from stylesim.errors import InputError, SimulationError
from stylesim.plugins.populate import SUMO_OPTIONS, StyledCrowd, populate
from stylesim.plugins.restyle import KEPT, OF_BASE, SETTERS
from stylesim.plugins.vtypes import export_vtypes
from stylesim.simulation.sumo.network import sumo_program
from stylesim.simulation.sumo.vehicles import Driver, type_attributes
from stylesim.styles import style_table
from stylesim.tracks import AgentKind, TrackFlag
from tests.unit.plugins.own_sumo import write_network, write_routes

pytest.importorskip("libsumo")
STEPS = 700


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("own")
    write_network(place)
    write_routes(place)
    return place


@pytest.fixture(scope="module")
def base_file(folder: Path) -> Path:
    return export_vtypes("tdbm_spectrum", folder / "styles.add.xml")


@contextlib.contextmanager
def running(kind: str, folder: Path, *extra: str, options: tuple[str, ...] = SUMO_OPTIONS) -> Iterator[Any]:
    """A started connection, closed at the end."""
    files = ["-n", str(folder / "crossing.net.xml"), "-r", str(folder / "Krauss.rou.xml")]
    command = [*files, *options, "--no-step-log", "--no-warnings", "--xml-validation", "never", *extra]
    if kind == "libsumo":
        import libsumo

        libsumo.start(["sumo", *command])
        try:
            yield libsumo
        finally:
            libsumo.close()
        return
    os.environ.pop("LIBSUMO_AS_TRACI", None)  # with it, `import traci` gives libsumo
    import traci

    label = f"test-{id(folder)}"
    with Path(os.devnull).open("w") as nowhere:
        traci.start([str(sumo_program("sumo")), *command], label=label, stdout=nowhere)
    try:
        yield traci.getConnection(label)
    finally:
        traci.getConnection(label).close()


def driven(sumo: Any, steps: int, **arguments: Any) -> StyledCrowd:
    """A crowd after so many steps."""
    crowd = populate(sumo, "tdbm_spectrum", 7, **arguments)
    for _ in range(steps):
        sumo.simulationStep()
        crowd.step()
    return crowd


def test_every_departed_motor_vehicle_has_the_attributes_of_its_driver(folder: Path, base_file: Path) -> None:
    with running("libsumo", folder, "-a", str(base_file)) as sumo:
        crowd = driven(sumo, 400)
        here = [name for name in sumo.vehicle.getIDList() if name in crowd.styles]
        assert len(here) >= 8
        for name in here:
            style, lorry = crowd.styles[name], "lorry" in name
            own = sumo.vehicle.getTypeID(name)
            assert own == f"{name}/styled"
            assert sumo.vehicletype.getMinGap(own) == pytest.approx(style.min_gap_m, abs=1e-3)
            factor = sumo.vehicle.getSpeedFactor(name)
            if style.flow_share == 0.0:
                assert factor == pytest.approx(style.desired_speed_factor, abs=1e-3)
            else:  # who looks at the traffic around has adapted by now
                assert 0.2 < factor < 1.6
            eagerness = float(sumo.vehicle.getParameter(name, "laneChangeModel.lcSpeedGain"))
            assert eagerness == pytest.approx(style.lane_change_eagerness, abs=0.01)
            if not lorry:
                assert sumo.vehicletype.getTau(own) == pytest.approx(style.time_headway_s, abs=1e-3)
                assert sumo.vehicle.getLength(name) == 4.7
                assert sumo.vehicle.getMaxSpeed(name) == 50
            else:
                assert sumo.vehicle.getVehicleClass(name) == "truck"
                assert sumo.vehicle.getAccel(name) < 1.3 * 2
        bikes = [name for name in sumo.vehicle.getIDList() if "bike" in name]
        assert bikes
        assert not set(bikes) & set(crowd.styles)
        assert all(sumo.vehicle.getTypeID(name) == "bike" for name in bikes)


def test_every_attribute_of_a_style_is_set_or_known_to_be_the_base_types() -> None:
    attributes = type_attributes(Driver("x", style_table("sumo").at(0.0), AgentKind.CAR, 4.5, 1.8, 0.0, ""))
    known = {*SETTERS, *KEPT, *OF_BASE}
    assert {name for name in attributes if not name.startswith(("lc", "jm"))} <= known


@pytest.mark.parametrize("kind", ["libsumo", "traci"])
def test_the_log_becomes_a_sound_corpus(kind: str, folder: Path, base_file: Path, tmp_path: Path) -> None:
    with running(kind, folder, "-a", str(base_file)) as sumo:
        crowd = populate(sumo, "tdbm_spectrum", 7)
        crowd.listen()
        for _ in range(STEPS):
            sumo.simulationStep()
        corpus = crowd.save(tmp_path / "own", scene_s=30.0)
        styles = dict(crowd.styles)
    assert ss.verify(tmp_path / "own").ok
    scenes = list(corpus)
    assert [scene.tracks.n_frames for scene in scenes] == [300, 300, 100]
    assert [scene.start_s for scene in scenes] == [0.0, 30.0, 60.0]
    assert len({scene.unit_id for scene in scenes}) == 1
    assert corpus.manifest["counts"]["pedal_noise_not_carried"] == 0
    for scene in scenes:
        tracks = scene.tracks
        assert scene.road is not None and scene.signals is not None
        for agent, driver in zip(tracks.agent_id, tracks.driver, strict=True):
            assert (driver is None) == ("bike" in agent)
            if driver is not None:
                assert driver.name == styles[agent].name
        assert {AgentKind.CAR, AgentKind.TRUCK} & {AgentKind(k) for k in tracks.kind} or scene is scenes[0]
    flags = [
        scene.tracks.flagged(TrackFlag.DECIDED_STOP) | scene.tracks.flagged(TrackFlag.DECIDED_GO) for scene in scenes
    ]
    assert sum(int(one.sum()) for one in flags) > 0
    last, first = scenes[0].tracks, scenes[1].tracks  # scenes follow each other without a gap or a jump
    both = [name for name in first.agent_id if name in last.agent_id]
    for name in both:
        i, j = last.agent_id.index(name), first.agent_id.index(name)
        if last.valid[i, -1] and first.valid[j, 0]:
            step = first.position_m[j, 0] - last.position_m[i, -1]
            assert np.hypot(*step) < 2.6  # 0.1 s at 26 m/s


def test_libsumo_and_traci_give_the_same_tracks(folder: Path, base_file: Path, tmp_path: Path) -> None:
    for kind in ("libsumo", "traci"):
        with running(kind, folder, "-a", str(base_file)) as sumo:
            driven(sumo, 250).save(tmp_path / kind)
    files = [
        {p.relative_to(tmp_path / kind): p.read_bytes() for p in (tmp_path / kind).rglob("*.parquet")}
        for kind in ("libsumo", "traci")
    ]
    assert files[0] == files[1]


def test_another_seed_gives_other_drivers_and_only_leaves_the_others_alone(folder: Path) -> None:
    chosen: list[dict[str, str]] = []
    for seed in (7, 7, 8):
        with running("libsumo", folder) as sumo, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            crowd = populate(
                sumo, {"x": 1} if False else "tdbm_spectrum", seed, only=lambda name: name.startswith("ew")
            )
            for _ in range(200):
                sumo.simulationStep()
                crowd.step()
            chosen.append({name: style.name for name, style in crowd.styles.items()})
            assert all(sumo.vehicle.getTypeID(n) == "car" for n in sumo.vehicle.getIDList() if n.startswith("wecar"))
    assert chosen[0] == chosen[1] != chosen[2]
    assert all(name.startswith("ew") for name in chosen[0])


def test_vehicles_that_are_there_already_get_drivers_too(folder: Path, tmp_path: Path) -> None:
    with running("libsumo", folder) as sumo:
        for _ in range(100):
            sumo.simulationStep()
        before = {name for name in sumo.vehicle.getIDList() if "bike" not in name}
        with pytest.warns(UserWarning, match="pedal noise"):
            crowd = driven(sumo, 50)
        corpus = crowd.save(tmp_path / "late", name="mine")
    assert before <= set(crowd.styles)
    (scene,) = corpus
    assert scene.start_s == 10.0
    assert scene.scenario == "mine"
    assert before <= set(scene.tracks.agent_id)
    assert corpus.manifest["counts"]["pedal_noise_not_carried"] == len(crowd.styles)


def without(option: str) -> tuple[str, ...]:
    at = SUMO_OPTIONS.index(option)
    return SUMO_OPTIONS[:at] + SUMO_OPTIONS[at + 2 :]


def test_options_that_do_not_fit_are_refused_before_anything_is_changed(folder: Path) -> None:
    for option, words in (("--step-length", "steps of 1 s"), ("--lanechange.duration", "jumps of one step")):
        with running("libsumo", folder, options=without(option)) as sumo, pytest.raises(InputError, match=words):
            populate(sumo, "tdbm_spectrum", 7)
    late = without("--tls.yellow.min-decel")
    with running("libsumo", folder, options=late) as sumo, pytest.warns(UserWarning, match="min-decel"):
        populate(sumo, "tdbm_spectrum", 7)


def test_a_network_that_is_not_there_or_is_none_is_refused(folder: Path) -> None:
    with running("libsumo", folder) as sumo:
        with pytest.raises(InputError, match="net="):
            populate(sumo, "tdbm_spectrum", 7, net=folder / "elsewhere.net.xml")
        with pytest.raises(InputError, match=r"Krauss\.rou\.xml"):
            populate(sumo, "tdbm_spectrum", 7, net=folder / "Krauss.rou.xml")


BAD: list[tuple[Callable[[Any], Any], str]] = [
    (lambda sumo: populate(object(), "tdbm_spectrum", 7), "no simulation, vehicle"),
    (lambda sumo: populate(sumo, "tdbm_spectum", 7), "'tdbm_spectrum'"),
    (lambda sumo: populate(sumo, "tdbm_spectrum", -1), "seed"),
    (lambda sumo: populate(sumo, "tdbm_spectrum", 7, log=False).save("x"), "log=False"),
    (lambda sumo: populate(sumo, "tdbm_spectrum", 7).save("x"), "0 steps"),
    (lambda sumo: populate(sumo, "tdbm_spectrum", 7).save("x", scene_s=0.0), "scene_s"),
]


def test_bad_input_says_what_is_wrong(folder: Path) -> None:
    with running("libsumo", folder) as sumo:
        for call, words in BAD:
            with pytest.raises(InputError, match=words):
                call(sumo)


def test_a_connection_without_a_simulation_is_refused() -> None:
    import libsumo

    with pytest.raises(InputError, match="start it first"):
        populate(libsumo, "tdbm_spectrum", 7)


def test_left_out_steps_are_noticed(folder: Path) -> None:
    with running("libsumo", folder) as sumo:
        crowd = populate(sumo, "tdbm_spectrum", 7)
        sumo.simulationStep()
        sumo.simulationStep()
        with pytest.raises(SimulationError, match="once after each"):
            crowd.step()


@pytest.mark.slow
def test_the_script_in_the_docs_runs_as_it_stands(tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / "docs" / "your_own_sumo.md").read_text(encoding="utf-8")
    script = page.split("```python\n")[1].split("```")[0]
    (tmp_path / "script.py").write_text(script)
    programs = os.pathsep.join([str(Path(sys.executable).parent), str(sumo_program("sumo").parent), os.environ["PATH"]])
    done = subprocess.run(
        [sys.executable, "script.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PATH": programs},
    )
    assert done.returncode == 0, done.stderr
    assert "5 scenes" in done.stdout
    assert ss.verify(tmp_path / "runs" / "mine").ok
