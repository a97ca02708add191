"""The colours of all pictures: eight that the colour-blind tell apart (Okabe and Ito)."""

BLACK, GREY = '#111111', '#999999'
BLUE, SKY, GREEN, ORANGE = '#0072b2', '#56b4e9', '#009e73', '#e69f00'
VERMILION, PINK, WINE = '#d55e00', '#cc79a7', '#882255'

TARGET, SOURCE = BLUE, ORANGE
INLIER, REJECTED = GREEN, WINE
RIGHT, WRONG, DIFFERENT = BLUE, ORANGE, WINE
"""Answers: right; wrong although the pair is of one place; to a pair of two places."""
TRUTH, ESTIMATE, LIMIT, LOST, SURE = BLACK, VERMILION, GREY, WINE, BLUE

SERIES = ((BLUE, 'o', '-'), (VERMILION, 's', '--'), (GREEN, '^', '-.'), (PINK, 'D', ':'),
          (ORANGE, 'v', '-'), (SKY, 'P', '--'), (WINE, 'X', '-.'), (BLACK, '*', ':'))
"""Colour, marker and line of the first, second and so on of several curves."""

CLASSES = {
    72: ('terrain', '#dfe9d3'), 40: ('road', '#c9c9cf'), 44: ('parking', '#c9c9cf'),
    48: ('sidewalk', '#f3dcea'), 49: ('floor', '#c9c9cf'), 52: ('structure', '#a9b7bd'),
    50: ('building', '#6f6f78'), 51: ('fence', ORANGE), 70: ('vegetation', GREEN),
    71: ('trunk', '#5b3a1a'), 10: ('car', SKY), 80: ('pole', PINK),
    81: ('traffic sign', WINE), 99: ('other', '#332288')}
"""Raw SemanticKITTI ids of the built-in world: name, colour; drawn in this order."""
GROUND = (72, 40, 44, 48, 49)
