"""What can go wrong, as exceptions: one base class, and an exit code for each kind."""

GOOD = 0
LIMIT_VIOLATED = 1
USAGE = 2
UNREADABLE = 3


class StanceError(Exception):
    """Base of every error that this package raises on purpose. Its text is one line that says what to do."""

    exit_code = USAGE


class UnreadableError(StanceError):
    """A file that is no log, or holds nothing that can be analysed."""

    exit_code = UNREADABLE


class MissingError(StanceError):
    """Something that this machine lacks: a program, a package, a privilege."""


class RunError(StanceError):
    """A process of a run could not start, or ended when it should not have."""
