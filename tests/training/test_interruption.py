import os
import signal
import threading

import pytest

from flyrl.training.callback import interruption


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_remembered_and_the_handler_put_back(number):
    before = signal.getsignal(number)
    with interruption() as interrupted:
        assert not interrupted
        os.kill(os.getpid(), number)
        assert interrupted == [number]
    assert signal.getsignal(number) == before


def test_asking_twice_interrupts_at_once():
    with pytest.raises(KeyboardInterrupt), interruption():
        os.kill(os.getpid(), signal.SIGTERM)
        os.kill(os.getpid(), signal.SIGINT)


def test_in_another_thread_signals_are_left_alone():
    before = signal.getsignal(signal.SIGTERM)
    seen = []

    def work():
        with interruption() as interrupted:
            seen.append((len(interrupted), signal.getsignal(signal.SIGTERM)))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [(0, before)]
