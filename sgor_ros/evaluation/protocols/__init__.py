"""Protocols: lists of pairs with the truth, and the thresholds within which an answer is right.

`kitti`, `indoor`, `posed` and `given` are those of the literature and of posed scans; `scenes` are
places of the built-in world, `solver` sets of matches to time; `studies` and `ablation` vary them.
"""
