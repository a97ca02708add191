"""The method: numpy arrays in, result objects out. No ROS, no printing.

`registration` is the method on one screen. The rooms: `scan` describes one scan, `matching` pairs
two, `solver` is the paper's Sec. III, `trust` judges, `common` is what all of them use.
"""
