"""One harness: methods answer the pairs of a protocol, metrics judge, a report shows.

Rooms, each above those that it uses: `metrics`, `methods`, `protocols` (which pairs, which
thresholds), and `report`. Between: `front_end` makes the matches that methods share, `job` and
`runner` run methods on pairs, `sequences` odometries on drives, `solver` times solvers.
"""
