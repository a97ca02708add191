"""The protocols of the literature: which pairs, which thresholds.

`pairs` are those of any drives, `kitti`, `indoor`, `drives` and `match_files` make protocols of
them; `studies` and `ablation` are what is varied; `truth` refines poses by ICP.
"""
