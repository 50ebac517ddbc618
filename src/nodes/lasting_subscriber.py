"""A subscriber of rospy that is not left alone by a publisher that begins again."""

import time

import rospy

IDLE = 10.0  # [s] without a connection, after which it subscribes anew: one may have been missed


class LastingSubscriber:
    """Where a publisher ends and begins again before rospy has seen the end, rospy takes the old connection
    for the new one, and connects no more. Who subscribes anew after the end is told by the master who publishes.
    For one thread."""

    def __init__(self, topic, kind, callback):
        self._arguments, self._was_connected = (topic, kind, callback), False
        self._subscribe()

    def _subscribe(self):
        self._subscriber = rospy.Subscriber(*self._arguments, tcp_nodelay=True)
        self.resolved_name = self._subscriber.resolved_name
        self._last_used = time.monotonic()

    def connections(self):
        """The present ones. To be asked again and again: it subscribes anew when the last one has ended."""
        found, now = list(self._subscriber.impl.connections), time.monotonic()
        if found:
            self._last_used = now
        elif self._was_connected or now - self._last_used > IDLE:
            self._subscriber.unregister()
            self._subscribe()
        self._was_connected = bool(found)
        return found
