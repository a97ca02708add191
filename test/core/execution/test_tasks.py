"""Two tasks at once, and what is made later."""
from threading import Barrier
from threading import Thread

import pytest

from sgor_ros.core.execution.lazy import Lazy
from sgor_ros.core.execution.tasks import run_both


def test_both_results_come_back_in_order():
    for threads in (1, 2, 4):
        assert run_both(threads, lambda: 'one', lambda: 2) == ('one', 2)


def test_tasks_may_share_out_tasks():
    assert run_both(2, lambda: run_both(2, lambda: 1, lambda: 2),
                   lambda: run_both(2, lambda: 3, lambda: 4)) == ((1, 2), (3, 4))


def test_an_error_in_either_is_raised():
    for tasks in ((lambda: 1 / 0, lambda: 2), (lambda: 1, lambda: 1 / 0)):
        with pytest.raises(ZeroDivisionError):
            run_both(2, *tasks)


def test_later_is_made_once_whoever_asks_first():
    made = []
    thing = Lazy(lambda: made.append(1) or 'thing')
    assert not made
    start = Barrier(4)
    found = []

    def ask():
        start.wait()
        found.append(thing())

    threads = [Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == ['thing'] * 4
    assert made == [1]
