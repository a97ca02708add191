"""The metrics of the field, each under its name.

`registration`: RE, TE, registration recall, inlier precision and recall; `trajectory`: APE (ATE),
RPE, drift as KITTI has it; `consistency`: NEES; `calibration`: outcomes, reliability diagram.
"""
from .consistency import nees as nees
from .consistency import NEES_BOUND as NEES_BOUND
from .consistency import track_consistency as track_consistency
from .registration import inlier_scores as inlier_scores
from .registration import kept_scores as kept_scores
from .registration import registration_recall as registration_recall
from .registration import rotation_error_deg as rotation_error_deg
from .registration import translation_error_m as translation_error_m
from .trajectory import ape as ape
from .trajectory import kitti_drift as kitti_drift
from .trajectory import rpe as rpe
