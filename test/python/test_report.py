"""The report: what it says of the demo's arm, and its messages for input that is wrong."""

import html.parser
import pathlib
import subprocess
import sys

import numpy as np
import pytest

from ist_proximity.report import measure

ROOT = pathlib.Path(__file__).resolve().parents[2]
URDF = ROOT / 'demo' / 'demo_arm.urdf'


def run(*arguments):
    return subprocess.run([sys.executable, ROOT / 'src' / 'tools' / 'proximity_report', *map(str, arguments)],
                          check=False, capture_output=True, text=True, timeout=200)


class Page(html.parser.HTMLParser):
    """The text of a page by its headings, and every address it refers to."""

    def __init__(self, text):
        super().__init__()
        self.sections, self.addresses, self.open, self.heading = {}, [], [], ''
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.addresses += [value for name, value in attrs if name in ('src', 'href')]
        if tag != 'meta':  # which has no end
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == 'h2':
            self.heading = data
        self.sections[self.heading] = self.sections.get(self.heading, '') + data + ' '


def test_page(wall_ply, tmp_path):
    output = tmp_path / 'report.html'
    result = run('--urdf', URDF, '--cloud', wall_ply, '--output', output, '--max-error', 0.01, 0.02,
                 '--tolerance', 0.001, 0, '--joints', 'shoulder_pitch=0.4')
    assert result.returncode == 0, result.stderr
    page = Page(output.read_text(encoding='utf-8'))
    assert page.open == [] and page.addresses == []  # whole, and complete without anything else
    assert 'max_error: 0.0' in page.sections['Recommended parameters']
    assert 'tool0' in page.sections['Warnings']  # a link without geometry
    assert '1600' in page.sections['Scene'] and 'shoulder_pitch 0.400' in page.sections['Scene']
    for link in ('base_link', 'gripper_link'):
        assert link in page.sections['Packing']
    assert '10' in page.sections['Speed against error'] and '20' in page.sections['Speed against error']


def test_recommended_setting():
    """The setting in use stays where no other is clearly faster; wider bounds than wanted never are."""
    def cost(max_error, tolerance, seconds):
        times = np.full(100, seconds)
        return measure.Cost(max_error, tolerance, times, times, times, times)

    in_use, other = cost(0.005, 0.001, 100e-6), cost(0.002, 0.0, 95e-6)
    coarse, fast = cost(0.005, 0.005, 10e-6), cost(0.01, 0.001, 50e-6)
    assert measure.recommend([in_use, coarse, other], 0.001) is in_use
    assert measure.recommend([in_use, coarse, other, fast], 0.001) is fast
    assert measure.recommend([in_use, coarse, other, fast], 0.005) is coarse
    assert measure.recommend([coarse], 0.001) is coarse  # none other was measured


@pytest.mark.parametrize('change, message', [
    ({'--cloud': 'cut.ply'}, 'is cut off'),
    ({'--cloud': 'none.pcd'}, 'none.pcd'),
    ({'--urdf': 'empty.urdf'}, 'no usable link'),
    ({'--urdf': 'robot.urdf.xacro'}, 'xacro'),
    ({'--joints': 'knee=1'}, 'no joint knee'),
    ({'--joints': 'knee'}, 'NAME=POSITION'),
    ({'--rate': '0'}, '--rate'),
    ({'--max-error': '-1'}, 'max_error'),
    ({'--cloud': 'damaged.bag'}, 'bag'),
])
def test_wrong_input(change, message, wall_ply, tmp_path):
    (tmp_path / 'cut.ply').write_text(wall_ply.read_text()[:300])
    (tmp_path / 'empty.urdf').write_text('<robot name="r"><link name="l"/></robot>')
    (tmp_path / 'robot.urdf.xacro').write_text(
        '<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro"><xacro:no_such_macro/></robot>')
    (tmp_path / 'damaged.bag').write_text('#ROSBAG V2.0\nnothing')
    arguments = {'--urdf': URDF, '--cloud': wall_ply, '--max-error': '0.02', '--tolerance': '0.001'}
    for name, value in change.items():
        arguments[name] = tmp_path / value if '.' in value else value
    result = run('--output', tmp_path / 'report.html',
                 *(word for pair in arguments.items() for word in pair))
    assert result.returncode != 0 and message in result.stderr, result.stderr
    assert 'Traceback' not in result.stderr
