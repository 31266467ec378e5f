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


def test_long_work_whose_bar_does_not_move_prints_how_much_is_left(shown, monkeypatch):
    now = iter((0.0, 50.0, 100.0, 150.0, 400.0))
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(now))
    monkeypatch.setattr(progress, "Progress", _Still)
    with progress.progress_bar("inverse RL", 1000, "problems") as advance:
        for done in (50, 50, 50, 50):
            advance(done)
    assert shown.getvalue().splitlines() == [
        "inverse RL: 100 of 1,000 problems, about 0:15:00 left",
        "inverse RL: 200 of 1,000 problems, about 0:26:40 left",
    ]


class _Still(progress.Progress):
    """A bar without its line at the end, and without a clock."""

    def __init__(self, *columns, **settings):
        super().__init__(*columns, **settings | {"disable": True}, get_time=lambda: 0.0)
