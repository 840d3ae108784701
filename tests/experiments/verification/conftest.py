"""What checks say of a part that is wrong."""

import pytest


@pytest.fixture
def exceeded(monkeypatch):
    """Runs the checks of a module after one of the functions that they call is replaced; what exceeds its bound."""

    def run(module, name=None, wrong=None):
        if name is not None:
            right = getattr(module, name)
            monkeypatch.setattr(module, name, lambda *given, **options: wrong(right(*given, **options)))
        return [deviation.what for check in module.CHECKS for deviation in check() if not deviation.within]

    return run
