"""Logs as data: topics, times, arrays, tables and plots of simulated and real flights.

Formats of files are in `volery.bridges.logs`; only ULog, which no bridge needs, is read here.

log = open_log("flight.mcap")
height = log["/uav1/odom"]["pose.pose.position.z"]
table = log.to_pandas("/*/odom", ["pose.pose.position"])
"""

from volery.logs.log import Log, open_log
from volery.logs.topic_data import LoggedMessage, TopicData
from volery.logs.trajectories import LoggedTrajectory
from volery.logs.transforms import LoggedTransforms, Transforms

__all__ = [
    "Log",
    "LoggedMessage",
    "LoggedTrajectory",
    "LoggedTransforms",
    "TopicData",
    "Transforms",
    "open_log",
]
