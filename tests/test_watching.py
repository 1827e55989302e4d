"""How far a fit is, as a terminal and a file show it."""

import io

from rich.console import Console

from trdlab.deep.fit_settings import FitProgress
from trdlab.verbs.watching import FitWatch

LEARNING = FitProgress(updates=1_200, error=0.4321, best=0.4, share=0.5)


def test_without_a_terminal_a_line_is_printed_now_and_then():
    text = io.StringIO()
    with FitWatch(1_000, Console(file=text, width=200)) as watch:
        watch.tell(400)
        watch.tell(LEARNING)
    assert text.getvalue() == "400 of 1,000 steps played\n", "ten seconds have not passed"
    with FitWatch(1_000, Console(file=text, width=200)) as watch:
        watch.tell(LEARNING)
    line = "1,200 updates, held-out error 0.432 of a constant guess's (least 0.4)\n"
    assert text.getvalue().endswith(line)


def test_on_a_terminal_a_bar_moves():
    console = Console(file=io.StringIO(), force_terminal=True, width=120)
    with FitWatch(1_000, console) as watch:
        watch.tell(400)
        assert watch.bar is not None
        task = watch.bar.tasks[0]
        assert (task.description, task.percentage) == ("400 of 1,000 steps played", 40.0)
        watch._shown = 0.0  # as if time had passed
        watch.tell(LEARNING)
        assert task.percentage == 50.0
        assert task.description.startswith("1,200 updates, held-out error 0.432")
