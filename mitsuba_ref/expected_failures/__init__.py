"""What is known to disagree, as a list that runs: `check` of each entry of `REGISTER`.

A method that fails where the textbook says it does is evidence too. If it starts to agree,
then the check has gone blind or the method was changed, and someone has to look.

`rounding, offsets, reference, light, cost` measure, one number for each entry; `register`
says what is expected.
"""

from mitsuba_ref.expected_failures.register import (
    REGISTER,
    ExpectedFailure,
    Outcome,
    check,
)

__all__ = ["REGISTER", "ExpectedFailure", "Outcome", "check"]
