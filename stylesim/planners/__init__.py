"""Somebody's own planner in the ego vehicle: what it is given, what it gives back, and one to start from.

`generate --ego package.module:name` imports the name; docs/planners.md is the page for authors.
"""

from stylesim.planners.answers import EgoControl as EgoControl
from stylesim.planners.answers import EgoTrajectory as EgoTrajectory
from stylesim.planners.answers import Planner as Planner
from stylesim.planners.baseline import IdmPlanner as IdmPlanner
