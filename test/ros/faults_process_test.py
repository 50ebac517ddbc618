#!/usr/bin/env python3
"""Faults of processes and files: kill -9 while packing and while writing the cache; a full disk."""

import os
import resource
import shutil
import signal
import subprocess
import tempfile
import time

import faults
import proximity_testing as pt
from proximity_testing import ProximityArray

MESH = "package://ist_proximity/demo/meshes/upper_arm.stl"
# The box is replaced by meshes, so that packing takes a while; several links make several files.
LINK = """<link name="mesh_%d"><collision><geometry><mesh filename="%s" scale="%g %g %g"/></geometry>
  </collision></link>
  <joint name="to_mesh_%d" type="fixed"><origin xyz="0 %g 0"/><parent link="base"/>
  <child link="mesh_%d"/></joint>"""
MESHES = 4
# How often the node is killed while it writes: more with IST_PROXIMITY_LONG_TESTS set.
KILLS = 25 if "IST_PROXIMITY_LONG_TESTS" in os.environ else 2


def urdf(scale=1.0):
    links = [
        LINK % (i, MESH, scale + 0.01 * i, scale, scale, i, 1.0 + 0.5 * i, i) for i in range(MESHES)
    ]
    return pt.urdf(extra="".join(links))


class FaultsProcessTest(faults.FaultTest):
    def setUp(self):
        super().setUp()
        # On a disk, where a file is not written at once.
        self.cache = tempfile.mkdtemp(dir=os.environ.get("ROS_HOME"))

    def tearDown(self):
        super().tearDown()
        shutil.rmtree(self.cache, ignore_errors=True)

    def launch(self, max_error=0.001, **keywords):
        # With link against link, every link is packed to the end, whatever is near.
        parameters = {
            "cache_directory": self.cache,
            "packing/max_error": max_error,
            "self_collision/enabled": True,
        }
        node = faults.TimedNode(self.namespace, parameters, urdf(), **keywords)
        return node

    def send_inputs(self):
        for i in range(MESHES):
            self.world.poses["mesh_%d" % i] = ("base", pt.transform((0, 1.0 + 0.5 * i, 0)))
        self.world.start_tf()
        self.sensor.start()

    def files(self, end=""):
        return [name for name in os.listdir(self.cache) if name.endswith(end)]

    def kill(self, node):
        node.process.send_signal(signal.SIGKILL)
        node.process.wait()
        node.stop()

    def start_again(self, since):
        """The same cache, a new process: OK, and the distance is right (checked at the end)."""
        self.nodes.append(self.launch())
        message = self.nodes[-1].wait_for_status(ProximityArray.OK)
        self.assertNotIn("is not used", self.nodes[-1].log())
        recovery = 1e3 * (time.monotonic() - since)
        self.nodes[-1].wait_until(lambda: self.files(".istpack"), "a packing in the cache")
        return message, recovery

    def test_killed_while_packing(self):
        self.send_inputs()
        node = self.launch()
        node.wait_for_status(ProximityArray.OK)
        node.wait_for_value("model", "mesh_0", "coarse")  # packing in the background
        self.kill(node)
        message, recovery = self.start_again(time.monotonic())
        self.record("kill -9 while packing", "the node is started again", message, None,
                    "packed, then OK", recovery, said="the cache holds whole packings only")

    def test_killed_while_writing_the_cache(self):
        """Killed as soon as a file that is not complete yet is there."""
        self.send_inputs()
        caught = 0
        for attempt in range(5 * KILLS):
            node = self.launch(listen=False, max_error=0.003 + 0.00002 * attempt)
            deadline = time.monotonic() + pt.TIMEOUT
            known = set(self.files(".tmp"))
            while not set(self.files(".tmp")) - known and len(self.files(".istpack")) < 99:
                self.assertLess(time.monotonic(), deadline, "no file in the cache: " + node.log())
                self.assertIsNone(node.process.poll(), node.log())
            self.kill(node)
            caught += bool(set(self.files(".tmp")) - known)
            if caught >= KILLS:
                break
        if not caught:
            self.skipTest("this disk writes files before they can be seen")
        message, recovery = self.start_again(time.monotonic())
        self.record("kill -9 while writing the cache", "the node is started again", message, None,
                    "what was cut off is packed again", recovery,
                    said="a file that was cut off is never read: it has another name")

    def test_full_disk(self):
        """A file system of 64 kB where mounting is allowed; else a limit for the size of files."""
        self.send_inputs()
        keywords = {}
        mount = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", self.cache], stderr=subprocess.DEVNULL
        )
        if mount.returncode == 0:
            with open(os.path.join(self.cache, "full"), "wb", buffering=0) as file:
                try:
                    while file.write(bytes(4096)):
                        pass
                except OSError:
                    pass
        else:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # inherited: a write fails instead

            def limit():
                resource.setrlimit(resource.RLIMIT_FSIZE, (1024, 1024))

            keywords["preexec_fn"] = limit
        try:
            since = time.monotonic()
            parameters = {"cache_directory": self.cache, "self_collision/enabled": True}
            self.nodes.append(
                faults.TimedNode(self.namespace, parameters, urdf(), **keywords))
            message = self.nodes[-1].wait_for_status(ProximityArray.OK)
            recovery = 1e3 * (time.monotonic() - since)
            if not keywords:  # the log's file is limited too
                self.nodes[-1].wait_until(
                    lambda: "cannot be written" in self.nodes[-1].log(), "a warning")
            self.assertEqual(self.files(".istpack"), [])
            self.assertEqual(self.files(".tmp"), [])
            self.record("full disk", "a cache on a full file system", message, None,
                        "packed, then OK", recovery,
                        said="log: the packing cache file cannot be written; " + "packed again next time")
        finally:
            if mount.returncode == 0:
                for node in self.nodes:
                    node.stop()
                subprocess.run(["umount", self.cache], check=True)


if __name__ == "__main__":
    pt.run("faults_process_test", FaultsProcessTest)
