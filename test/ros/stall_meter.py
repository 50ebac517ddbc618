"""What a busy machine adds to times that a test measures."""

import threading
import time


class StallMeter:
    """How late a thread of this process wakes: what the machine adds to every time measured here."""

    STEP = 0.005

    def __init__(self):
        self._stalls = []  # (time at which it woke, how late)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        before = time.monotonic()
        while not self._stop.wait(self.STEP):
            now = time.monotonic()
            self._stalls.append((now, now - before - self.STEP))
            before = now

    def worst(self, begin, end):
        """[s] The latest that it woke between two times of time.monotonic()."""
        return max([late for t, late in list(self._stalls) if begin <= t <= end + 0.1] + [0.0])

    def stop(self):
        self._stop.set()
        self._thread.join()


def undisturbed(measure, longest=0.1, attempts=10):
    """What measure() returns, of a time in which no thread woke later than `longest` [s].

    What is sent at 20 Hz then comes in time. A machine that is never that free has the last word.
    """
    stalls = StallMeter()
    try:
        for _ in range(attempts):
            begin = time.monotonic()
            measured = measure()
            if stalls.worst(begin, time.monotonic()) < longest:
                break
    finally:
        stalls.stop()
    return measured
