"""Batches: find the inputs, name the outputs, and run a command on all of them; a failed input stops no other.

A command supplies the work for one task and the columns of its table.
"""

from cvtimg.batch.pipes import STANDARD, is_pipe, is_standard
from cvtimg.batch.plans import Outputs, Pattern, Plan, check_suffix, find, plan_each, plan_one
from cvtimg.batch.report import Report, complain, reason
from cvtimg.batch.runner import INTERRUPTED, Running, check_plan, fold, run
from cvtimg.batch.tasks import InputsFailedError, Missing, Row, Stopwatch, Task, Work, WrongUsageError

__all__ = [
    "INTERRUPTED",
    "STANDARD",
    "InputsFailedError",
    "Missing",
    "Outputs",
    "Pattern",
    "Plan",
    "Report",
    "Row",
    "Running",
    "Stopwatch",
    "Task",
    "Work",
    "WrongUsageError",
    "check_plan",
    "check_suffix",
    "complain",
    "find",
    "fold",
    "is_pipe",
    "is_standard",
    "plan_each",
    "plan_one",
    "reason",
    "run",
]
