"""Evaluation, for those who installed ``sgor_ros[evaluation]``: one harness for all benchmarks.

`protocols` list pairs to register and the thresholds of success, `methods` are what is compared,
`runner` runs them in turns and returns a row for each pair and method, `metrics` judge, `report`
makes tables and pictures; `odometry` runs whole drives. `pairs` has the types that they share.
"""
