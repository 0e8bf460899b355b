from .columns import Dialect as Dialect
from .estimator import CVT as CVT
from .files import Table as Table
from .files import find_tables as find_tables
from .files import read_table as read_table
from .files import write_clusters as write_clusters
from .files import write_generators as write_generators
from .files import write_row_labels as write_row_labels
