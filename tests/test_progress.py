"""Progress bars: where they end."""

import io

import pytest
from rich.console import Console

from relm_irl_jax import progress


@pytest.fixture
def shown(monkeypatch):
    text = io.StringIO()
    monkeypatch.setattr(progress, "console", Console(file=text, width=120))
    return text


@pytest.mark.parametrize(("steps", "end"), [((6, 3), "9/9"), ((6, 6), "10/10"), ((10,), "10/10")])
def test_a_bar_ends_at_its_total(shown, steps, end):
    with progress.progress_bar("training", 10, "frames") as advance:
        for done in steps:
            advance(done)
    assert end in shown.getvalue()


def test_a_bar_of_nothing_and_one_that_was_broken_off_stay(shown):
    with progress.progress_bar("training", 10, "frames"):
        pass
    with pytest.raises(ValueError, match="10"), progress.progress_bar("evaluating", 10, "frames") as advance:
        advance(4) or int("ten, base 10")
    assert " 0/10" in shown.getvalue()
    assert " 4/10" in shown.getvalue()
