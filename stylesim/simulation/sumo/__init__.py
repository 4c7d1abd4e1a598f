"""The SUMO backend. Importing this package loads no libsumo; making a `SumoBackend` does."""

from stylesim.simulation.sumo.runner import SumoBackend as SumoBackend
