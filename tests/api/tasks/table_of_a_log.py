"""Makes one table of all UAVs in a log."""

from volery.logs import open_log

table = open_log("flight.mcap").to_pandas("/*/odom", ["pose.pose.position"])
print(table.groupby("uav").max())
