"""The page of a report: one HTML file that needs nothing else."""

import html
import platform

import numpy as np

from . import drawing, measure

_STYLE = '''
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 2rem auto;
  padding: 0 1rem; }
h1 { margin-bottom: 0; } h2 { margin-top: 2.2rem; border-bottom: 1px solid #ddd; }
table { border-collapse: collapse; margin: 1rem 0; } th, td { padding: .2rem .7rem; text-align: right;
  border-bottom: 1px solid #eee; } th:first-child, td:first-child { text-align: left; }
.wide { overflow-x: auto; } svg { display: block; } svg.chart { width: 36rem; }
svg text { font: 12px system-ui, sans-serif; }
svg .grid { stroke: #ddd; } .links { display: flex; flex-wrap: wrap; gap: 1rem; }
.links figure { margin: 0; width: 10rem; } .links svg { width: 10rem; } figcaption { font-size: 13px; }
.warning { background: #fff4e0; border-left: 4px solid #e69500; padding: .3rem .8rem; margin: .4rem 0; }
code, pre { background: #f5f5f5; padding: .1rem .3rem; } pre { padding: .6rem .9rem; }
.note { color: #666; font-size: 13px; }
'''


def _table(head, rows):
    cells = ''.join(f'<th>{html.escape(name)}</th>' for name in head)
    lines = [f'<div class="wide"><table><tr>{cells}</tr>']
    for row in rows:
        lines.append('<tr>' + ''.join(f'<td>{html.escape(str(cell))}</td>' for cell in row) + '</tr>')
    return '\n'.join(lines) + '</table></div>'


def _us(seconds):
    return f'{1e6 * seconds:.0f}'


def _mm(metres):
    return f'{1e3 * metres:.2f}'


def _processor():
    try:
        with open('/proc/cpuinfo', encoding='utf-8') as file:
            names = [line.split(':', 1)[1].strip() for line in file if line.startswith('model name')]
        return f'{names[0]}, {len(names)} cores'
    except (OSError, IndexError):
        return platform.processor() or 'unknown processor'


def _summary(report, rate, error):
    best, deadline = report.best, 0.5 / rate
    p99 = np.percentile(report.paced.cycle, 99)
    fits = 'fits' if p99 < deadline else 'does not fit'
    lines = [f'<p>For {rate:g} answers a second with bounds within {_mm(error)} mm of the distance, '
             'the best of the settings that were measured:</p><pre>',
             f'packing:\n  max_error: {best.max_error:g}      # [m]\n',
             f'query:\n  tolerance: {best.tolerance:g}      # [m]\n  deadline: {deadline:g}      # [s]',
             f'</pre><p>At this rate a cycle takes {_us(np.median(report.paced.cycle))} µs in the median '
             f'and {_us(p99)} µs in the 99th percentile, which {fits} half of the period of '
             f'{_us(1.0 / rate)} µs.']
    if p99 >= deadline:
        lines.append(' The deadline then ends some answers early: they hold, with wider bounds, and '
                     'their status is DEGRADED.')
    lines.append('</p>')
    return ''.join(lines)


def _packing(report):
    rows, figures = [], []
    for link, more in zip(report.robot.packing, report.packing):
        if link['error']:
            continue
        name, count = link['link'], len(link['radii'])
        share = more['filled_volume'] / max(more['solid_volume'], 1e-12)
        rows.append((name, link['triangles'] or '-', more['open_edges'], count, _mm(link['max_gap']),
                     _mm(link['mean_gap']), f'{1e6 * more["solid_volume"]:.0f}', f'{share:.0%}'))
        figures.append(f'<figure>{drawing.spheres(link["centers"], link["radii"])}'
                       f'<figcaption>{html.escape(name)}: {count} spheres</figcaption></figure>')
    head = ('link', 'triangles', 'open edges', 'spheres', 'largest gap [mm]', 'mean gap [mm]',
            'volume [cm³]', 'filled')
    return (_table(head, rows) + '<div class="links">' + ''.join(figures) + '</div>'
            '<p class="note">A link without triangles is made of boxes, cylinders and spheres. Packed in '
            f'{report.packing_time:.1f} s of processor time.</p>')


def _speed(report):
    rows, lines = [], {}
    for cost in sorted(report.costs, key=lambda one: (one.max_error, one.tolerance)):
        half, high, largest = np.percentile(cost.cycle, (50, 99, 100))
        rows.append((f'{1e3 * cost.max_error:g}', f'{1e3 * cost.tolerance:g}', _us(half), _us(high),
                     _us(largest), _us(np.median(cost.repulsion)), _mm(cost.width.max())))
        if cost.tolerance > 0.0:
            line = lines.setdefault(f'to {1e3 * cost.max_error:g} mm', [])
            line.append((1e3 * cost.tolerance, 1e6 * half))
    head = ('max_error [mm]', 'tolerance [mm]', 'median [µs]', '99 % [µs]', 'largest [µs]',
            'of it repulsion [µs]', 'widest bound [mm]')
    chart = drawing.log_chart([(name, *zip(*sorted(line))) for name, line in lines.items()],
                              'tolerance [mm]', 'median cycle [µs]') if lines else ''
    return _table(head, rows) + chart


def _deadlines(report):
    rows = [(f'{share:.0%}', _us(deadline), _mm(width), f'{known:.1%}')
            for share, deadline, width, known in report.deadlines]
    chart = drawing.log_chart([('mean width', [1e6 * row[1] for row in report.deadlines],
                                [max(1e3 * row[2], 1e-3) for row in report.deadlines])],
                              'deadline [µs]', 'widest bound of a cycle, mean [mm]')
    return _table(('of the 99th percentile', 'deadline [µs]', 'widest bound, mean [mm]',
                   'cycles with every link known'), rows) + chart


def _cost(report, rate):
    ingest, cycle = np.median(report.ingest), report.paced.cycle
    load = measure.CLOUD_RATE * ingest + rate * cycle.mean()
    rows = [('an image or cloud, median', f'{1e3 * ingest:.2f} ms'),
            ('a cycle, median', f'{_us(np.median(cycle))} µs'),
            ('a cycle, 99th percentile', f'{_us(np.percentile(cycle, 99))} µs'),
            (f'{measure.CLOUD_RATE:g} clouds and {rate:g} cycles a second', f'{load:.0%} of a core')]
    rows += [(f'memory: {name}', f'{size / 2**20:.1f} MB') for name, size in report.memory.items()]
    return _table(('what', 'cost'), rows)


def _scene(report):
    counts = report.obstacles.counts
    rows = [(name.replace('_', ' '), count) for name, count in counts.items()]
    states = {0: 'UNKNOWN', 1: 'CLEAR', 2: 'NEAR', 3: 'CONTACT'}
    answer = [(name, states[int(report.answer.state[i])], f'{report.answer.lower_bound[i]:.4f}',
               f'{report.answer.distance[i]:.4f}') for i, name in enumerate(report.robot.links)]
    joints = ', '.join(f'{name} {value:.3f}' for name, value in zip(report.robot.joints, report.q))
    return (f'<p>{html.escape(report.scene.origin)}</p>' + _table(('points', 'count'), rows) +
            f'<p>At the configuration {html.escape(joints)}:</p>' +
            _table(('link', 'state', 'at least [m]', 'distance [m]'), answer))


def render(report, rate, error, version):
    """The whole page as text."""
    name = html.escape(report.robot.name)
    warnings = ''.join(f'<p class="warning">{html.escape(text)}</p>' for text in report.warnings)
    steps = len(report.costs[0].query)
    sections = [
        ('Recommended parameters', _summary(report, rate, error)),
        ('Warnings', warnings or '<p>None.</p>'),
        ('What it costs', _cost(report, rate) +
         '<p class="note">The recommended setting as a node runs it, in one thread of this machine: '
         f'{rate:g} cycles a second with query and repulsion of every link, asleep between them, and '
         f'{measure.CLOUD_RATE:g} new clouds a second, indexed by another thread. Without messages.</p>'),
        ('Speed against error', _speed(report) +
         f'<p class="note">{steps} steps of {measure.PIECES} random motions within the limits of the '
         f'joints, in steps of 1 ms and up to {measure.SPEED:g} rad/s, with a new cloud every '
         f'{measure.PER_CLOUD} steps, one at once after the other: to compare settings. A thread that '
         'sleeps between its cycles takes longer for each, as above.</p>'),
        ('Bounds against the deadline', _deadlines(report)),
        ('Packing', _packing(report)),
        ('Scene', _scene(report)),
    ]
    body = ''.join(f'<h2>{title}</h2>{content}' for title, content in sections)
    return (f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
            f'<meta name="viewport" content="width=device-width"><title>{name}</title>'
            f'<style>{_STYLE}</style></head><body><h1>{name}</h1>'
            f'<p class="note">proximity_report of ist_proximity {html.escape(version)}, '
            f'{html.escape(_processor())}</p>{body}</body></html>\n')
