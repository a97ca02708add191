"""How a loop is closed.

`loop_closing` is the way of a loop: `candidates` (which pairs to try and when), `verification`
(they are registered), `loop_consistency` (which loops to believe, by `paths`: the surest way
between two nodes), and the pose graph takes them in.
"""
