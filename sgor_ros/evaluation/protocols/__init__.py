"""The protocols of the literature: which pairs, which matches, which thresholds, which tables.

`kitti`, `indoor` and `drives` make protocols; `front_end` the matches that all methods share;
`run` runs them; `tables`, `plots` and `page` show what came out beside `published` rows.
"""
