"""Motion on arrays: the one smoother, derivatives along the path, neighbours, leaders, gaps, time to collision."""

from stylesim.kinematics.encroachment import Encroachments as Encroachments
from stylesim.kinematics.encroachment import encroachments as encroachments
from stylesim.kinematics.following import Leaders as Leaders
from stylesim.kinematics.following import corridor_leaders as corridor_leaders
from stylesim.kinematics.following import required_deceleration_mps2 as required_deceleration_mps2
from stylesim.kinematics.following import time_headway_s as time_headway_s
from stylesim.kinematics.following import time_to_collision_s as time_to_collision_s
from stylesim.kinematics.neighbours import Closing as Closing
from stylesim.kinematics.neighbours import closing_on_neighbours as closing_on_neighbours
from stylesim.kinematics.neighbours import displaced as displaced
from stylesim.kinematics.smoothing import Motion as Motion
from stylesim.kinematics.smoothing import Smoother as Smoother
from stylesim.kinematics.smoothing import motion as motion
