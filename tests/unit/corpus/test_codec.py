from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.corpus.codec import decode, encode
from stylesim.tracks import AgentKind, Tracks


def any_tracks(n, frames, seed, share, dt_s):
    rng = np.random.default_rng(seed)
    valid = rng.random((n, frames)) < share
    ahead = np.where(valid, rng.integers(0, 3, (n, frames)), 0)

    def fill(values):
        mask = valid if values.ndim == 2 else valid[..., None]
        return np.where(mask, values, np.nan)

    return Tracks(
        agent_id=tuple(map(str, range(n))),
        kind=np.full(n, AgentKind.CAR),
        size_m=np.ones((n, 2)),
        position_m=fill(rng.normal(0, 10 ** rng.uniform(0, 4.5), (n, frames, 2))),
        velocity_mps=fill(rng.normal(0, 50, (n, frames, 2))),
        heading_rad=fill(rng.uniform(-np.pi, np.pi, (n, frames))),
        valid=valid,
        dt_s=dt_s,
        lookahead_steps=ahead,
    )


@settings(deadline=None, max_examples=200)
@given(
    st.integers(0, 4),
    st.integers(1, 12),
    st.integers(0, 2**32),
    st.floats(0, 1),
    st.sampled_from([0.1, 0.04, 1 / 29.97, 0.5]),
)
def test_decoding_undoes_encoding(n, frames, seed, share, dt_s):
    tracks = any_tracks(n, frames, seed, share, dt_s)
    names = ("position_m", "velocity_mps", "heading_rad")
    hollow = {name: np.full_like(getattr(tracks, name), np.nan) for name in names}
    empty = replace(tracks, **hollow, valid=np.zeros_like(tracks.valid), lookahead_steps=None)
    got = decode(encode(tracks), empty)
    np.testing.assert_array_equal(got.valid, tracks.valid)
    large = float(np.nanmax(np.abs(tracks.position_m), initial=1.0))
    np.testing.assert_allclose(got.position_m, tracks.position_m, atol=5.1e-4 + large * 1.3e-7)
    np.testing.assert_allclose(got.velocity_mps, tracks.velocity_mps, atol=5.1e-3)
    turn = np.exp(1j * got.heading_rad) - np.exp(1j * tracks.heading_rad)
    assert np.nanmax(np.abs(turn), initial=0.0) < 5.1e-4
    want = tracks.lookahead_steps if tracks.lookahead_steps.any() else None
    np.testing.assert_array_equal(got.lookahead_steps, want) if want is not None else None


def test_steady_motion_costs_nothing_but_its_start():
    t = np.arange(600) * 0.1
    position = np.stack([np.stack([10.0 * t, 0 * t], -1)])
    one = Tracks(
        agent_id=("a",), kind=np.ones(1, int), size_m=np.array([[4.0, 2.0]]), position_m=position, dt_s=0.1,
        velocity_mps=np.full((1, 600, 2), [10.0, 0.0]), heading_rad=np.zeros((1, 600)), valid=np.ones((1, 600), bool),
    )  # fmt: skip
    columns = encode(one)
    assert all(not columns[name][2:].any() for name in ("ddx", "ddy", "rvx", "rvy", "dh"))
