"""Experiments on training: arms that differ in one thing, over several seeds, compared on the same drivers."""
