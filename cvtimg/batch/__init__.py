"""Many inputs: which they are, where their outputs go, and a run in which one that fails stops no other.

Nothing here knows what is done to an input: a command hands over the work, and the columns of its table.
"""

from cvtimg.batch.report import Report, complain, reason
from cvtimg.batch.runner import Running, check_can_be_written, fold, run
from cvtimg.batch.tasks import (
    Missing,
    Row,
    Task,
    Work,
    WrongUsageError,
    check_choice,
    check_no_clash,
    check_outputs,
    find,
)

__all__ = [
    "Missing",
    "Report",
    "Row",
    "Running",
    "Task",
    "Work",
    "WrongUsageError",
    "check_can_be_written",
    "check_choice",
    "check_no_clash",
    "check_outputs",
    "complain",
    "find",
    "fold",
    "reason",
    "run",
]
