"""The one exception type that a user sees."""


class BimVerifyError(Exception):
    """One clear sentence: what is wrong, in which file or setting, and what to do. No traceback is shown for it."""


class Cancelled(Exception):
    """The user stopped the work (Esc, Ctrl-C); nothing was written."""
