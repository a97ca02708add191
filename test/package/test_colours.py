"""Colours that stand side by side in a picture look different, to the colour-blind too."""
from itertools import combinations

from matplotlib.colors import to_rgb
import numpy as np
import pytest

from sgor_ros.io import colours

# of linear RGB: Machado, Oliveira, Fernandes 2009, severity 1
SEEN_BY = {
    'everybody': np.eye(3),
    'protanopes': [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                   [-0.003882, -0.048116, 1.051998]],
    'deuteranopes': [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                     [-0.011820, 0.042940, 0.968881]]}
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
WHITE = TO_XYZ.sum(axis=1)
# CIE76; 2.3 is just noticed by two patches side by side
APART = 10

TOGETHER = {
    'clouds and matches': (colours.TARGET, colours.SOURCE, colours.INLIER, colours.REJECTED),
    'answers': (colours.RIGHT, colours.WRONG, colours.DIFFERENT),
    'track': (colours.TRUTH, colours.ESTIMATE, colours.LIMIT, colours.SURE),
    'curves': tuple(colour for colour, _, _ in colours.SERIES),
    'things on a map': (colours.ESTIMATE, colours.TRUTH, *(
        colour for label, (_, colour) in colours.CLASSES.items()
        if label not in colours.GROUND))}


def lab(colour, seen):
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055)**2.4)
    xyz = TO_XYZ @ np.clip(np.array(seen) @ linear, 0, 1) / WHITE
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize('who', SEEN_BY)
@pytest.mark.parametrize('group', TOGETHER)
def test_no_two_look_the_same(group, who):
    for a, b in combinations(TOGETHER[group], 2):
        assert np.linalg.norm(lab(a, SEEN_BY[who]) - lab(b, SEEN_BY[who])) > APART, (a, b)
