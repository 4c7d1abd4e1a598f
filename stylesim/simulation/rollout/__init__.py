"""A recording continued with styled drivers: an own light simulation on the recorded `Road`, without any simulator."""

from stylesim.simulation.rollout.generate import generate_from as generate_from
