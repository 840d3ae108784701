"""What each choice does."""

from fifesim.experiments.friedl1995 import effects as friedl1995_effects
from fifesim.experiments.friedl1995.case import Case


def test_every_chosen_number_is_changed_once():
    case = Case()
    changed = friedl1995_effects.changes(case)
    assert len({change.name for change in changed}) == len(changed) == 10
    assert all(change.case != case for change in changed)
