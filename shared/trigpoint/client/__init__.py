"""What a client of the map embeds: landmarks asked for and kept in step, detections placed, a pose found among them.

Needs neither gtsam nor SQL.
"""
