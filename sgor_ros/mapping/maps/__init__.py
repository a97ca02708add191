"""Maps that stay: kept in a folder, found again, joined.

`map` (what a map holds), `localisation` and `result` (where in it a scan was taken), `merging`
(two maps become one), `relocalisation` (where in one the sensor is, while it is lost), `occupancy`
(a grid of what is free, from above). Its folder is read and written by `io/map_folder.py`.
"""
