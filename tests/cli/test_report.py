"""What a failure is told as."""

from psim.report import report


def test_an_interrupt_in_the_middle_of_an_import_is_one(capsys):
    error = RuntimeError("Error calling __set_name__")
    error.__cause__ = KeyboardInterrupt()
    assert report(error) == 130
    assert capsys.readouterr().err == "interrupted: stopped\n"
