"""What `sgor_benchmark` measures: a module each, which `commands.benchmark` lists.

Each has `HELP`, `add_options` and `measure`, which prints a table and writes table.md, rows.csv,
run.json and a plot into the folder that it is given.
"""
