"""Rows of other papers, as printed: they stand beside ours and were not measured here.

KITTI, 10 m and 3DMatch: the tables of the SGOR paper (FPFH). Loops: HKUST's LiDAR registration
benchmark, per sequence, weighted by pairs.
"""
from typing import NamedTuple


class Published(NamedTuple):
    """RR, IP, IR and F1 in percent, RE in degrees, TE in centimetres; None where not printed."""

    method: str
    recall: float
    rotation_deg: float | None = None
    translation_cm: float | None = None
    precision: float | None = None
    inlier_recall: float | None = None
    f1: float | None = None


KITTI_10M = (
    Published('PointDSC', 97.12, 0.59, 8.98, 85.35, 81.08, 82.82),
    Published('DGR', 78.21, 1.78, 32.12, 78.39, 54.12, 62.15),
    Published('VBReg', 96.04, 0.70, 15.29, 91.68, 92.19, 91.88),
    Published('SM', 77.66, 0.63, 13.22, 40.05, 93.98, 53.58),
    Published('TEASER', 90.27, 1.32, 15.74, 82.56, 68.08, 73.98),
    Published('SC2-PCR', 97.84, 0.58, 9.44, 90.07, 92.75, 91.27),
    Published('MAC', 98.20, 0.60, 8.71),
    Published('Segregator', 70.12, 1.52, 18.81),
    Published('Pagor', 76.39, 0.91, 17.25),
    Published('SGOR', 98.92, 0.51, 7.50, 92.70, 94.59, 93.53))
"""The 555 pairs, 5 deg and 60 cm. DHVR is printed with FCGF alone: 98.20 %."""

KITTI_LEVELS = {
    'PointDSC': (97.12, 95.14, 67.03), 'VBReg': (96.04, 88.65, 27.75),
    'SM': (77.66, 69.73, 39.28), 'SC2-PCR': (97.84, 96.94, 59.82),
    'Segregator': (70.12, 54.10, 10.68), 'Pagor': (76.39, 58.01, 9.18),
    'SGOR': (98.92, 97.66, 76.40)}
"""RR at easy, medium and hard."""

THREEDMATCH = (
    Published('PointDSC', 45.78, 2.82, 8.53, 38.46, 40.17, 38.87),
    Published('VBReg', 55.70, 3.17, 9.42, 46.33, 49.93, 47.69),
    Published('SM', 31.25, 4.10, 11.09, 28.11, 51.84, 32.24),
    Published('RANSAC', 6.41, 6.41, 15.24, 5.30, 34.06, 8.54),
    Published('SC2-PCR', 60.81, 2.94, 8.83, 51.26, 57.27, 53.74),
    Published('SGOR', 65.01, 2.51, 9.02, 55.12, 55.90, 55.51))
"""Clouds of a single depth map each, 15 deg and 30 cm: not the fragments of the benchmark, for
which SC2-PCR prints 83.98 %."""

KITTI_LOOPS = {
    'G3Reg (GEM, PAGOR)': (98.6, 93.1, 71.7), 'FPFH, PAGOR': (100.0, 93.8, 61.1),
    'FPFH, Quatro': (99.3, 90.2, 55.8), 'FPFH, TEASER++': (99.0, 84.9, 47.0),
    'FPFH, 3DMAC': (97.9, 71.1, 30.6)}
"""RR at 5 deg and 2 m in the bands 0-10, 10-20 and 20-30 m (914, 1,151 and 1,260 pairs)."""

ROWS = {'kitti_10m': KITTI_10M, '3dmatch': THREEDMATCH, 'depth_frames': THREEDMATCH}
"""By protocol."""
