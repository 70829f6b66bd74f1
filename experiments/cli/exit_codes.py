"""What the commands end with, for scripts."""

USER_ERROR = 2
OUTAGE = 3
"""A run was stopped because its language model could not be had; the same command, or --resume, goes on."""

INTERRUPTED = 130

STOPPED = {"budget-spent": 0, "outage": OUTAGE, "interrupted": INTERRUPTED}
"""By status of a run that is not at its end."""
