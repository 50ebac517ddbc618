"""A ROS master of its own for a measurement, and the helpers of the rostests."""

import os
import pathlib
import socket
import subprocess
import sys
import time
import xmlrpc.client

ROOT = pathlib.Path(__file__).resolve().parent.parent
PATIENCE = 30.0  # [s]


class PrivateMaster:
    """Runs until stop(); rospy of this process belongs to it."""

    def __init__(self, name):
        with socket.socket() as free:
            free.bind(('', 0))
            port = free.getsockname()[1]
        os.environ['ROS_MASTER_URI'] = f'http://localhost:{port}'
        os.environ.setdefault('ROS_HOSTNAME', 'localhost')
        self.process = subprocess.Popen(['rosmaster', '--core', '-p', str(port)],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        server = xmlrpc.client.ServerProxy(os.environ['ROS_MASTER_URI'])
        end = time.monotonic() + PATIENCE
        while True:
            try:
                server.getPid(name)
                break
            except OSError:
                if time.monotonic() > end:
                    raise
                time.sleep(0.05)
        sys.path.insert(0, str(ROOT / 'test' / 'ros'))
        import rospy
        rospy.init_node(name, disable_signals=True, log_level=rospy.ERROR)
        import proximity_testing
        self.testing = proximity_testing

    def stop(self):
        self.process.terminate()
        self.process.wait()


def rewrite(page, name, text):
    """Puts a text between the markers of a document."""
    page = pathlib.Path(page)
    head, begin, rest = page.read_text(encoding='utf-8').partition(f'<!-- {name} -->\n')
    _, end, tail = rest.partition(f'<!-- end of {name} -->\n')
    if not end:
        sys.exit(f'{page}: the markers of "{name}" are missing')
    page.write_text(head + begin + text + end + tail, encoding='utf-8')
