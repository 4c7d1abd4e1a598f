"""Checkpoints that are not ours are refused, and nothing in them is run."""

from __future__ import annotations

import os
import pickle

import pytest
import torch


class Evil:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (self.path,)


@pytest.mark.parametrize("kind", ["torch", "pickle", "random", "text", "empty", "foreign", "newer", "cut"])
def test_a_foreign_checkpoint_is_refused(kind, stylesim, corpus, tmp_path):
    file, trap = tmp_path / "model.pt", tmp_path / "trap"
    whole = {"format": "stylesim-forecaster", "version": 1}
    if kind == "torch":
        torch.save({**whole, "state": Evil(str(trap))}, file)
    elif kind == "pickle":
        file.write_bytes(pickle.dumps(Evil(str(trap)), protocol=4))
    elif kind == "foreign":
        torch.save({"weights": torch.zeros(3)}, file)
    elif kind == "newer":
        torch.save({**whole, "version": 99}, file)
    elif kind == "cut":
        torch.save({**whole, "state": torch.zeros(5000)}, file)
        file.write_bytes(file.read_bytes()[:5000])
    else:
        file.write_bytes({"random": bytes(range(1, 256)) * 20, "text": b"hello\n", "empty": b""}[kind])
    said = stylesim("evaluate", file, corpus, "--by", "scenario", "--out", tmp_path / "new")
    assert said.code == 2
    assert ("install a newer one" if kind == "newer" else "is not a checkpoint of stylesim") in said.err
    assert "weights_only" not in said.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["corpus", "model.pt"]
