"""Widgets for napari that call cvtimg."""
