"""Terminal output of commands."""

import logging
import os
import signal

import pytest

from fifesim.base.messages import LOG, quiet
from fifesim.output.terminal import Exit, exit_with_error, in_time, interrupts_blocked, listening, print_lines, report


def test_last_line_gives_the_duration_and_the_file_to_open(capsys):
    report(["out/image.tif"], 75.2, "out/report.html in a browser")
    assert capsys.readouterr().out.splitlines() == [
        "out/image.tif",
        "done in 1 min 15 s: open out/report.html in a browser",
    ]
    with quiet():
        report(["out/image.tif"], 75.2, "out/report.html")
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("seconds", "said"), [(0.04, "0.0 s"), (59.94, "59.9 s"), (59.96, "1 min 0 s"), (3599.6, "1 h 0 min")]
)
def test_durations_never_show_60_seconds_or_60_minutes(seconds, said):
    assert in_time(seconds) == said


def test_log_is_printed_only_inside_the_context(capsys):
    before = LOG.level
    with listening(logging.INFO):
        LOG.info("a name \x1b[31m")
        LOG.debug("a part")
    LOG.info("afterwards")
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("a name \\x1b[31m")
    assert not LOG.handlers and LOG.level == before


def test_control_characters_are_escaped(capsys):
    print_lines("one\x1b[31m", "two\nthree")
    assert capsys.readouterr().out == "one\\x1b[31m\ntwo\nthree\n"


@pytest.mark.parametrize("code", Exit)
def test_error_gives_its_exit_code_and_at_most_500_characters(code, capsys):
    with pytest.raises(SystemExit) as caught:
        exit_with_error(ValueError("x" * 2000), code)
    assert caught.value.code == code
    said = capsys.readouterr().err
    assert said.startswith("fifesim: xxx") and len(said) <= 501


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals cannot be blocked on Windows")
def test_interrupt_is_delayed_until_the_context_ends():
    done, before = [], signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt), interrupts_blocked():
            os.kill(os.getpid(), signal.SIGINT)
            done.append("rest")
    finally:
        signal.signal(signal.SIGINT, before)
    assert done == ["rest"] and signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
