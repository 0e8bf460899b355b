"""Batches: find the inputs, name the outputs, and run a command on all of them; a failed input stops no other.

A command supplies the work for one task and the columns of its table.
"""

from cvtimg.batch.plans import Outputs, Plan, check_suffix, find, plan_each, plan_one, searched
from cvtimg.batch.report import Report
from cvtimg.batch.runner import Running, fold, run
from cvtimg.batch.tasks import InputsFailedError, Row, Stopwatch, Task, Work, WrongUsageError

__all__ = [
    "InputsFailedError",
    "Outputs",
    "Plan",
    "Report",
    "Row",
    "Running",
    "Stopwatch",
    "Task",
    "Work",
    "WrongUsageError",
    "check_suffix",
    "find",
    "fold",
    "plan_each",
    "plan_one",
    "run",
    "searched",
]
