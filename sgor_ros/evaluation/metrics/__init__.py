"""Metrics of the field, a file each.

`pose_error` (RE, TE, NEES), `inliers` (IP, IR, F1), `trajectory` (APE, RPE, drift),
`registration_recall`, `reliability` (confidence against the share that is right), `consistency`
(NEES along a track); and `row`, what one method made of one pair.
"""
