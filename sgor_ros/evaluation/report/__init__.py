"""Tables, pictures and the files that a benchmark leaves.

`cells` defines what is printed, `pair_tables`, `consistency_tables`, `odometry_tables`,
`solver_table` and `protocol_tables` put it together, `plots`, `trajectory_plots` and
`protocol_plots` draw; `protocol_page` and `files` write, `published` has rows of papers.
"""
