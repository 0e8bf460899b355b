"""Hierarchies: trees of regions, from which any number of regions is cut."""
