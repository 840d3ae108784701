"""A logger for who listens, and no word otherwise."""

import logging

from fifesim.base.messages import LOG, is_quiet, quiet


def test_the_logger_is_called_fifesim_and_has_no_handlers():
    assert LOG is logging.getLogger("fifesim") and not LOG.handlers


def test_quiet_ends_with_its_context():
    with quiet():
        assert is_quiet()
        with quiet(False):
            assert not is_quiet()
        assert is_quiet()
    assert not is_quiet()
