"""highway-env as a backend: styled vehicles on its roads, logged in our frame (see `backend`)."""

from stylesim.simulation.highway.backend import HighwayBackend as HighwayBackend
