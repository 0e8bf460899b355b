from .estimator import CVT
from .files import Scaling, Table, find_tables, read_table, write_generators, write_row_labels

__all__ = ["CVT", "Scaling", "Table", "find_tables", "read_table", "write_generators", "write_row_labels"]
