"""Pairs of scans: the type, which are chosen, and what methods are given of them.

`pair` has the types, `selection` near, listed and different places, `files` matches from files,
`front_end` scans and matches of a pair for methods, `truth` poses refined by ICP.
"""
