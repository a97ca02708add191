"""What a notebook shows of a result: verdict, pose and picture, as HTML that a parser takes."""
import math
import re
from xml.etree import ElementTree

import numpy as np

from sgor_ros import register
from sgor_ros import register_correspondences
from sgor_ros import SemanticScan
from sgor_ros.core.verdict.result import Placement
from sgor_ros.core.verdict.result import Registration
from sgor_ros.core.verdict.result import Status

T = np.array([[0., -1, 0, 3], [1, 0, 0, 4], [0, 0, 1, 0], [0, 0, 0, 1]])


def shown(result):
    """Return the rows of the table, name to text, and the picture."""
    root = ElementTree.fromstring(result._repr_html_())
    rows = {row.find('th').text: ''.join(row.find('td').itertext()) for row in root.iter('tr')}
    return rows, root.find('svg')


def test_a_registered_pair():
    rng = np.random.default_rng(0)
    source = rng.uniform(-20, 20, (300, 3))
    target = source @ T[:3, :3].T + T[:3, 3]
    target[::10] += 5.0
    result = register_correspondences(source, target)
    rows, svg = shown(result)
    assert rows['status'] == 'registered '
    assert rows['motion'] == '5.000 m, 90.000 deg'
    assert rows['correspondences'] == f'{int(result.inliers.sum())} inliers of 300'
    assert np.allclose([list(map(float, line.split()))
                        for line in rows['T_target_source'].split('\n')], T, atol=1e-3)
    circles = svg.findall('circle')
    blue = [c for c in circles if c.get('fill') == '#1f77b4']
    grey = [c for c in circles if c.get('fill') == '#bbbbbb']
    assert len(blue) == result.inliers.sum() + 1
    assert len(grey) == (~result.inliers).sum()
    at = {c.get('fill'): np.array([float(c.get('cx')), float(c.get('cy'))])
          for c in circles if c.get('r') == '5'}
    # the source is ahead and to the left of the target: up is y
    metres = float(re.search(r'(\d+) m wide', svg.find('title').text)[1])
    moved = (at['#d62728'] - at['#1f77b4']) / 320 * metres
    assert np.allclose(moved, [3, -4], atol=0.1)


def test_one_of_several_places_and_markup_in_its_words():
    result = Registration(
        Status.AMBIGUOUS, 'a <b> & c', T, np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, bool),
        covariance=np.diag([0.01, 0.04, 0.09, 0.01, 0.01, 0.01]), warnings=('<script>',),
        alternatives=(Placement(np.eye(4), None, np.empty((0, 6))),))
    rows, svg = shown(result)
    assert rows['status'] == 'ambiguous a <b> & c'
    assert rows['or else'] == '0.000 m, 0.000 deg'
    assert rows['warning'] == '<script>'
    assert rows['standard deviation'] == '10.0 20.0 30.0 cm, ' + ' '.join(
        [f'{math.degrees(0.1):.3f}'] * 3) + ' deg'
    assert [c.get('fill') for c in svg.findall('circle')].count('none') == 1


def test_no_solution_has_no_picture():
    rows, svg = shown(register(SemanticScan(np.zeros((50, 3))), SemanticScan(np.zeros((50, 3)))))
    assert rows['status'].startswith('no solution ')
    assert svg is None
