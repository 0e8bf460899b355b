"""Budgets that many modules share: how much is held, worked on or looked at at a time; and what counts as rounding.

Those of memory suit machines of 8 GB. NumPy is not imported here, so that the options of ``--help`` may name them.
"""

#: Colors, segments or runs: as many as 16 bits number, which indices and labels are stored with.
MAX_COLORS = 1 << 16
#: Points of a grid or a mesh: with more, 32 bits do not number the edges between them.
MOST_POINTS = 1 << 28
#: Pixels, cells or vertices that are in memory as a whole, at 100 bytes or so for each: larger files are read in parts.
MOST_IN_MEMORY = 1 << 26
#: Pixels of a band or a tile: with more, each takes longer to fill, and more than 1 GB in a segmentation.
PIXELS_AT_ONCE = 1 << 23
#: Rows or samples that are worked on or looked at at a time: with more, temporary arrays take more than 100 MB.
ROWS_AT_ONCE = 1 << 20
#: Samples of which a figure is taken, such as a range or a mean: with more, it takes longer and is hardly another.
SAMPLES_OF_FIGURE = 1 << 16
#: Numbers of a temporary array that stays in the cache of a core: with more, each pass fetches them from memory again.
IN_CACHE = 1 << 15
#: Samples by which a sum over a region is right to about a thousandth: four times as many halve that, and take as long.
ENOUGH_SAMPLES = 1 << 17
#: Share of its size by which a place that is given may be off: files have six digits or more. With more, what is
#: elsewhere is taken to be there.
GIVEN = 1e-6
#: Share by which sums of doubles may be off: some thousand roundings. With more, what is nearly alike counts as alike.
ROUNDING = 1e-12
