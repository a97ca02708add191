"""Tables and pictures of what was measured.

Of `sgor_benchmark`: `tables`, `plots`, `outcomes`, `reliability_diagram`, `consistency_table`. Of
`sgor_tables`: `page`, `protocol_tables` and `protocol_plots`, beside `published` rows.
"""
