"""Palette formats: functions from the bytes of a file to its colors, and from swatches to bytes."""
