"""The two ways refgi speaks of trouble: an error that stops, a warning that counts.

Every error that a user can cause is an `InputError`; its message names the file, the key and the value, and the
command line prints it as one line. What a renderer sensibly passes over (zero-area faces, say) is a `RefgiWarning`
that says how many.
"""


class RefgiError(Exception):
    """Anything refgi raises on purpose."""


class InputError(RefgiError, ValueError):
    """A scene, setting, file or array that cannot be used; the message says what, where and why."""


class RefgiWarning(UserWarning):
    """Something was passed over and the picture is still right; the message says what and how many."""


def expect(condition: bool, parameter: str, expected: str, got: object) -> None:
    """Raise `InputError` naming parameter, expectation and value unless `condition` holds.

    Parameters
    ----------
    condition : bool
        What must hold.
    parameter : str
        Name of the parameter, as the caller wrote it.
    expected : str
        What would have been right.
    got : object
        What was given.
    """
    if not condition:
        raise InputError(f"{parameter}: expected {expected}, got {got!r}")
