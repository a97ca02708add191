"""The method: numpy arrays in, result objects out. No ROS, no printing.

`registration` is the method on one screen, `preprocessing` what is done to each scan before. The
rooms, each above those that it uses: `common`, `execution`, `scan`, `features`, `index`,
`matching`, `scoring`, `solver` (the paper's Sec. III), `icp`, `degeneracy`, `hypotheses`,
`verdict`.
"""
