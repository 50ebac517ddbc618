"""Draws the soak's table as an SVG: one strip for each quantity, over the time."""

from xml.sax.saxutils import escape

import numpy as np

WIDTH, STRIP, LEFT, RIGHT, TOP = 900, 130, 90, 20, 30
COLOURS = ("#2c7a4b", "#8e8e8e", "#c0392b", "#e08e0b", "#7d3c98", "#2c3e50", "#3d7dca")
# Title, unit, factor, columns; several columns are stacked.
STRIPS = (
    ("resident memory", "MB", 1, ("rss_mb",)),
    ("threads", "", 1, ("threads",)),
    ("descriptors", "", 1, ("descriptors",)),
    ("p99 of computation_time", "ms", 1e3, ("computation_p99_s",)),
    ("p99 of latency, status OK", "ms", 1e3, ("latency_p99_s",)),
    ("messages a second by status", "", 1,
     ("OK", "NO_CLOUD", "STALE_CLOUD", "NO_POSE", "DEGRADED", "MODEL_ERROR", "LOADING")),
)


def _text(x, y, words, anchor="start", colour="#333"):
    return '<text x="%.1f" y="%.1f" text-anchor="%s" fill="%s">%s</text>' % (
        x, y, anchor, colour, escape(words))


def _path(xs, ys, colour):
    points = ["%.1f,%.1f" % (x, y) for x, y in zip(xs, ys) if np.isfinite(y)]
    return '<polyline points="%s" fill="none" stroke="%s"/>' % (" ".join(points), colour)


def _strip(strip, top, xs, rows, header):
    title, unit, factor, names = strip
    values = np.array([rows[:, header.index(name)] * factor for name in names])
    lowest, highest = np.nanmin(values), np.nanmax(values)
    if title.endswith("status"):
        lowest = 0.0
    span = (highest - lowest) or 1.0
    bottom = top + STRIP - 35
    parts = [
        '<line x1="%d" y1="%d" x2="%d" y2="%d" stroke="#ccc"/>' % (LEFT, y, WIDTH - RIGHT, y)
        for y in (top, bottom)
    ]
    parts.append(_text(LEFT, top - 6, title))
    for value, y in ((highest, top + 4), (lowest, bottom + 4)):
        parts.append(_text(LEFT - 8, y, ("%.4g %s" % (value, unit)).strip(), "end"))
    for i, row in enumerate(values):
        colour = COLOURS[i]
        parts.append(_path(xs, bottom - (row - lowest) / span * (bottom - top), colour))
        if len(names) > 1:
            parts.append(_text(LEFT + 210 + 100 * i, top - 6, names[i], colour=colour))
    return parts


def write(path, rows, header):
    seconds = rows[:, 0]
    xs = LEFT + seconds / seconds[-1] * (WIDTH - LEFT - RIGHT)
    height = TOP + STRIP * len(STRIPS) + 10
    parts = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 %d %d" font-family="sans-serif" '
             'font-size="12">' % (WIDTH, height), '<rect width="100%" height="100%" fill="white"/>']
    for i, strip in enumerate(STRIPS):
        parts += _strip(strip, TOP + i * STRIP, xs, rows, header)
    parts.append(_text(WIDTH - RIGHT, height - 8, "%.1f min" % (seconds[-1] / 60), "end"))
    with open(path, "w", encoding="utf-8") as file:
        file.write("\n".join(parts) + "\n</svg>\n")
