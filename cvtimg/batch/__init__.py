"""Batches: find the inputs, name the outputs, and run a command on all of them; a failed input stops no other.

A command supplies the work for one task and the columns of its table.
"""
