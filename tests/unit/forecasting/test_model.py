from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from stylesim.errors import InputError
from stylesim.forecasting.batching import gather
from stylesim.forecasting.config import FUSIONS, InputConfig, ModelConfig, model_config
from stylesim.forecasting.model import ForecastNetwork
from stylesim.forecasting.objective import mixture_loss
from stylesim.forecasting.samples import RoadCutter, add_window
from stylesim.forecasting.selection import selected_modes
from stylesim.forecasting.store import MemorySink, StoreBuilder
from stylesim.forecasting.tensors import TensorBatch
from stylesim.scene import Scene
from stylesim.windows import WindowSpec
from tests.conftest import make_scene

from .made import INPUTS, SMALL, untrained

STYLE = torch.tensor([[0, 0, 0], [1, 2, 1], [-1, -1, -1], [0, 1, 0]])


def inputs_of(scene: Scene, config: InputConfig = INPUTS) -> TensorBatch:
    """The first four cars at frame 40."""
    sink = MemorySink(config)
    history = scene.history(40, config.history_steps)
    rows = add_window(StoreBuilder(sink), RoadCutter(config), history, np.arange(4, dtype=np.int32), config)
    sink.append("sample", rows)
    return TensorBatch.of(gather(sink.store(), np.arange(4), config))


def network(**changes: Any) -> ForecastNetwork:
    return untrained(styled=bool(changes.get("styles")), **changes).network


def test_every_layer_gives_a_mixture_of_the_right_shape() -> None:
    layers = network()(inputs_of(make_scene()))
    assert len(layers) == 2
    for modes in layers:
        assert modes.mean_m.shape == modes.log_sd.shape == (4, 8, 30, 2)
        assert modes.logit.shape == (4, 8)
        assert torch.isfinite(modes.mean_m).all()


@pytest.mark.parametrize("fusion", FUSIONS)
def test_without_a_known_style_it_is_the_unconditioned_network_at_the_start(fusion: str) -> None:
    styled, plain = network(styles=2, fusion=fusion), network(seed=1)
    state = {k: v for k, v in styled.state_dict().items() if not k.startswith("style.")}
    plain.load_state_dict(state)
    inputs = inputs_of(make_scene())
    with torch.no_grad():
        for a, b in zip(styled(inputs, None), plain(inputs), strict=True):
            assert torch.equal(a.mean_m, b.mean_m)
            assert torch.equal(a.logit, b.logit)


@pytest.mark.parametrize("fusion", FUSIONS)
def test_a_known_style_moves_its_driver_and_nobody_else(fusion: str) -> None:
    model = network(styles=2, fusion=fusion)
    inputs = inputs_of(make_scene())
    with torch.no_grad():
        moved = (model(inputs, STYLE)[-1].mean_m - model(inputs, None)[-1].mean_m).abs().amax(dim=(1, 2, 3))
    assert (moved[[0, 1, 3]] > 1e-5).all()
    assert moved[2] == 0


def test_paths_start_at_the_vehicle_with_its_velocity() -> None:
    model = network()
    inputs = inputs_of(make_scene())
    anchor = model.anchors(inputs)
    velocity = inputs.agent[:, 0, -1, 2:4]
    start = anchor[:, :, 0] / 0.1
    # in a tenth of a second an acceleration of a few m/s2 changes nothing much
    torch.testing.assert_close(start, velocity[:, None].expand_as(start), atol=0.6, rtol=0)


def test_intentions_are_those_of_the_band_of_speed() -> None:
    model = network()
    model.intention_mps2.zero_()
    inputs = inputs_of(make_scene())
    speed = inputs.agent[:, 0, -1, 2:4].norm(dim=-1)
    model.intention_mps2[3, :, 0] = 1.0  # 8 to 12 m/s
    still = (model.anchors(inputs)[:, 0, -1] - 3.0 * inputs.agent[:, 0, -1, 2:4]).norm(dim=-1)
    assert ((still > 4.0) == ((speed >= 8) & (speed < 12))).all()


def test_road_and_signals_may_be_absent_and_matter_when_present() -> None:
    scene = make_scene()
    model = network()
    with torch.no_grad():
        whole, dark, bare = (
            model(inputs_of(s))[-1].mean_m
            for s in (scene, replace(scene, signals=None), replace(scene, road=None, signals=None))
        )
    assert torch.isfinite(bare).all()
    assert not torch.equal(whole, dark)
    assert not torch.equal(dark, bare)


@pytest.mark.parametrize(("history_s", "future_s"), [(1.1, 8.0), (2.1, 6.0), (5.0, 6.0)])
def test_any_length_of_history_and_future(history_s: float, future_s: float) -> None:
    config = InputConfig.of(WindowSpec(history_s, future_s), 0.1)
    model = ForecastNetwork(model_config("tiny", config, **SMALL))
    assert model(inputs_of(make_scene(), config))[-1].mean_m.shape == (4, 8, round(future_s * 10), 2)


def test_tiny_has_about_half_a_million_parameters() -> None:
    model = ForecastNetwork(model_config("tiny", InputConfig.of(WindowSpec(), 0.1), styles=6))
    assert 0.35e6 < sum(p.numel() for p in model.parameters()) < 0.65e6


def test_the_configuration_comes_back_from_its_dictionary() -> None:
    config = model_config("small", INPUTS, fusion="late", reading="R3", styles=2)
    assert ModelConfig.from_dict(config.to_dict()) == config
    with pytest.raises(InputError, match="queries"):
        ModelConfig.from_dict({**config.to_dict(), "querys": 3})


@pytest.mark.parametrize("changes", [{"fusion": "erly"}, {"reading": "R7"}, {"width": 63}, {"modes": 99}])
def test_an_impossible_network_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        model_config("tiny", INPUTS, **changes)
    with pytest.raises(InputError, match="Did you mean 'tiny'"):
        model_config("tinny", INPUTS)


@pytest.mark.parametrize("fusion", FUSIONS)
def test_prediction_gives_what_the_last_mixture_and_a_selection_give(fusion: str) -> None:
    net, inputs = network(styles=2, fusion=fusion), inputs_of(make_scene())
    with torch.no_grad():
        last = net(inputs, STYLE)[-1]
        expected = selected_modes(last.mean_m, last.logit, count=net.config.modes, apart_m=net.config.nms_m)
        found = net.predict(inputs, STYLE)
    for one, other in zip(found, expected, strict=True):
        torch.testing.assert_close(one, other, atol=1e-4, rtol=0)


def test_the_path_that_learns_gives_the_loss_and_the_gradient_of_all_paths() -> None:
    model, inputs = network(), inputs_of(make_scene())
    future = model.anchors(inputs)[torch.arange(4), torch.tensor([0, 3, 5, 7])] + 1.0
    learner = torch.tensor([0, 3, 5, 7])
    assert model(inputs, None, learner)[0].mean_m.shape == (4, 1, 30, 2)
    gradients = []
    for wanted in (None, learner):
        model.zero_grad()
        loss = mixture_loss(model(inputs, None, wanted), model.anchors(inputs), future)
        loss.mean().backward()  # type: ignore[no-untyped-call]
        gradients.append((loss.detach(), [p.grad for p in model.parameters()]))
    torch.testing.assert_close(*gradients)


def test_only_what_exists_is_looked_at() -> None:
    model, inputs = network(), inputs_of(make_scene())
    gone = inputs.token_valid.clone()
    gone[:, [3, -1, -2]] = False
    inputs = replace(inputs, token_valid=gone)
    missing = ~inputs.token_valid
    agents = inputs.agent.shape[1]
    assert missing[:, :agents].any()
    assert missing[:, agents:].any()
    agent, piece = inputs.agent.clone(), inputs.piece.clone()
    agent[missing[:, :agents]] = 9.0
    piece[missing[:, agents:]] = 9.0
    with torch.no_grad():
        whole, changed = (model(i)[-1].mean_m for i in (inputs, replace(inputs, agent=agent, piece=piece)))
    torch.testing.assert_close(whole, changed)
