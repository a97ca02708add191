"""Degeneracy: directions in which two clouds slide on each other, so that nothing holds them.

`localizability` finds weak directions, `perturbation_test` tries them, `directions` says what
comes of it.
"""
