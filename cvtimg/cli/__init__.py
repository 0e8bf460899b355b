"""The commands of the command line, one file each: options, what is done to one input, and its row in the report.

Whatever is heavy is imported where it is used, so that ``cvtimg --help`` and wrong usage answer at once.
"""
