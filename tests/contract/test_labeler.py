"""What any labeller must do. To run it on yours: subclass `LabelerContract` and give `make`."""

from __future__ import annotations

import inspect
import json

import numpy as np
import pytest

from stylesim.labelers.base import Labeler
from stylesim.labelers.kdsc import KDSC
from stylesim.labelers.mdsi import MDSI
from stylesim.labelers.tdbm import TDBM
from stylesim.labels import UNDETERMINED

from ..unit.labelers.made import scene_of, straight, traffic


class LabelerContract:
    """The tests; `make` gives an unfitted labeller with its default parameters."""

    def make(self) -> Labeler:
        raise NotImplementedError

    @pytest.fixture
    def fitted(self) -> Labeler:
        return self.make().fit([traffic(seed=1)])

    def test_the_constructor_stores_its_parameters_and_learns_nothing(self) -> None:
        made = self.make()
        assert isinstance(made, Labeler)
        for name in inspect.signature(type(made).__init__).parameters:
            assert name == "self" or hasattr(made, name)
        assert not [name for name in vars(made) if name.endswith("_")]

    def test_fit_returns_the_labeller_and_takes_any_iterable(self) -> None:
        made = self.make()
        assert made.fit(iter([traffic(seed=1)])) is made

    def test_every_motor_vehicle_has_one_track_row(self, fitted: Labeler) -> None:
        scene = traffic(agents=10, seed=2)
        found = fitted.label_windows(scene)
        assert found.method == fitted.method
        assert found.span == "track"
        assert found.agent_id == scene.tracks.agent_id
        assert found.score.shape == (10, len(found.classes))
        known = found.style != UNDETERMINED
        assert known.any()
        np.testing.assert_array_equal(found.style[known], found.score[known].argmax(axis=1))
        np.testing.assert_array_equal(found.missing, ~np.isfinite(found.feature))

    def test_agents_are_answered_in_the_order_asked(self, fitted: Labeler) -> None:
        scene = traffic(agents=10, seed=2)
        asked = np.array([7, 2], np.int32)
        for span in ("track", "history"):
            starts = None if span == "track" else [20]
            some = fitted.label_windows(scene, starts, 50 if starts else None, span=span, agents=asked)
            all_ = fitted.label_windows(scene, starts, 50 if starts else None, span=span)
            assert some.agent_id == ("car-7", "car-2")
            np.testing.assert_array_equal(some.score, all_.score[asked])

    def test_nobody_asked_is_no_row(self, fitted: Labeler) -> None:
        none = np.zeros(0, np.int32)
        assert len(fitted.label_windows(traffic(), agents=none)) == 0
        assert len(fitted.label_windows(traffic(), [0], 50, span="history", agents=none)) == 0

    def test_an_agent_unknown_at_t0_is_undetermined(self, fitted: Labeler) -> None:
        late = straight(0, 10)
        late[:60] = np.nan
        scene = scene_of([late, straight(30, 9)])
        found = fitted.label_windows(scene, [0], 50, span="history", agents=np.array([0], np.int32))
        assert found.class_name(0) == "undetermined"

    def test_json_keeps_every_bit(self, fitted: Labeler) -> None:
        again = type(fitted).from_dict(json.loads(json.dumps(fitted.to_dict())))
        scene = traffic(agents=10, seed=2)
        for span, starts, steps in (("track", None, None), ("history", [30], 50)):
            a, b = (one.label_windows(scene, starts, steps, span=span) for one in (fitted, again))
            for name in ("score", "style", "margin", "aggressiveness", "feature", "flags"):
                np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
            assert a.provenance == b.provenance
            json.dumps(dict(a.provenance))


class TestTDBM(LabelerContract):
    def make(self) -> Labeler:
        return TDBM()


class TestTransposedTDBM(LabelerContract):
    def make(self) -> Labeler:
        return TDBM(orientation="transposed")


class TestKDSC(LabelerContract):
    def make(self) -> Labeler:
        return KDSC()


class TestMDSI(LabelerContract):
    def make(self) -> Labeler:
        rng = np.random.default_rng(7)
        return MDSI(answers={f"car-{i}": rng.integers(1, 7, 44).tolist() for i in range(12)})
