"""Progress as lines of JSON, and nothing where nobody looks."""

import json

from fifesim.output.progress import CellProgress, memory, steps


def test_lines_say_where_the_run_is(capsys):
    with CellProgress(cells=100, done=40, as_json=True) as progress:
        progress.advance(60)
    first, last = map(json.loads, capsys.readouterr().out.splitlines())
    assert (first["cells_done"], first["seconds_left"]) == (40, None)
    assert (last["cells_done"], last["cells"], last["seconds_left"]) == (100, 100, 0)
    assert last["cells_per_second"] > 0 and last["memory"] > 10e6


def test_lines_are_a_second_apart(capsys):
    with CellProgress(cells=10**6, as_json=True) as progress:
        for _ in range(50):
            progress.advance(1)
    assert len(capsys.readouterr().out.splitlines()) < 10


def test_nothing_is_printed_without_a_terminal(capsys):
    with CellProgress(cells=2) as progress:
        progress.advance(2)
    assert list(steps([1, 2], "counting")) == [1, 2]
    assert capsys.readouterr() == ("", "")


def test_memory_is_that_of_a_python_with_numpy():
    assert 20e6 < memory() < 100e9
