"""Plays clouds to a running `sgor_node` over DDS: for the demo and for the tests."""
