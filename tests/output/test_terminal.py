"""What commands say stays in its lines."""

import pytest

from fifesim.output.terminal import Exit, say, stop, tell


def test_names_from_elsewhere_cannot_steer_a_terminal(capsys):
    say("one\x1b[31m", "two\nthree")
    assert capsys.readouterr().out == "one\\x1b[31m\ntwo\nthree\n"


def test_a_warning_is_a_line(capsys):
    tell(UserWarning("a\nb"))
    assert capsys.readouterr().err == "fifesim: warning: a\\nb\n"


@pytest.mark.parametrize("code", Exit)
def test_a_mistake_ends_with_its_code_and_at_most_500_characters(code, capsys):
    with pytest.raises(SystemExit) as caught:
        stop(ValueError("x" * 2000), code)
    assert caught.value.code == code
    said = capsys.readouterr().err
    assert said.startswith("fifesim: xxx") and len(said) <= 501
