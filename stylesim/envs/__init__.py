"""Gymnasium environments: an ego among drivers of every style."""
