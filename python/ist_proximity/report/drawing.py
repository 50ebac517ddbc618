"""Pictures of a report as SVG."""

import html

import numpy as np

_COLORS = ('#1f77b4', '#d95f02', '#2a9d5c', '#7570b3', '#c0392b')


def _number(value):
    return f'{value:.6g}'


def log_chart(lines, x_label, y_label, width=560, height=320):
    """Lines over logarithmic axes. lines: (name, x, y) with positive numbers."""
    left, bottom, top, right = 64, 44, 14, 130
    xs = np.concatenate([np.asarray(x, float) for _, x, _ in lines])
    ys = np.concatenate([np.asarray(y, float) for _, _, y in lines])
    span = [(np.floor(np.log10(v.min() * 0.999)), np.ceil(np.log10(v.max() * 1.001)))
            for v in (xs, ys)]

    def place(x, y):
        u = (np.log10(x) - span[0][0]) / max(span[0][1] - span[0][0], 1.0)
        v = (np.log10(y) - span[1][0]) / max(span[1][1] - span[1][0], 1.0)
        return (left + u * (width - left - right), height - bottom - v * (height - top - bottom))

    parts = [f'<div class="wide"><svg class="chart" viewBox="0 0 {width} {height}" role="img" '
             f'aria-label="{html.escape(y_label)}">']
    for axis in (0, 1):
        for exponent in np.arange(span[axis][0], span[axis][1] + 1):
            value = 10.0 ** exponent
            x0, y0 = place(*((value, 10 ** span[1][0]) if axis == 0 else (10 ** span[0][0], value)))
            x1, y1 = place(*((value, 10 ** span[1][1]) if axis == 0 else (10 ** span[0][1], value)))
            parts.append(f'<line class="grid" x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}"/>')
            anchor = 'middle' if axis == 0 else 'end'
            dx, dy = (0, 16) if axis == 0 else (-6, 4)
            parts.append(f'<text x="{x0 + dx:.1f}" y="{y0 + dy:.1f}" text-anchor="{anchor}">'
                         f'{_number(value)}</text>')
    for index, (name, x, y) in enumerate(lines):
        color = _COLORS[index % len(_COLORS)]
        points = [place(a, b) for a, b in zip(x, y)]
        path = ' '.join(f'{a:.1f},{b:.1f}' for a, b in points)
        parts.append(f'<polyline points="{path}" fill="none" stroke="{color}" stroke-width="2"/>')
        parts += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3" fill="{color}"/>' for a, b in points]
        parts.append(f'<text x="{width - right + 10}" y="{top + 14 + 18 * index}" fill="{color}">'
                     f'{html.escape(name)}</text>')
    parts.append(f'<text x="{(left + width - right) / 2}" y="{height - 8}" text-anchor="middle">'
                 f'{html.escape(x_label)}</text>')
    parts.append(f'<text transform="translate(14 {height / 2}) rotate(-90)" text-anchor="middle">'
                 f'{html.escape(y_label)}</text></svg></div>')
    return ''.join(parts)


def spheres(centers, radii, size=180, most=1500):
    """Spheres seen from the side, the far ones first and darker."""
    keep = radii > 0.0
    centers, radii = centers[keep], radii[keep]
    if len(radii) == 0:
        return '<p>no spheres with a volume</p>'
    order = np.argsort(-radii)[:most]
    centers, radii = centers[order], radii[order]
    # An oblique view: x to the right and a little down, y to the back, z up.
    view = np.array([[0.87, -0.5, 0.0], [0.25, 0.43, 0.87], [0.43, 0.75, -0.5]])
    seen = centers @ view.T
    low, high = (seen[:, :2] - radii[:, None]).min(0), (seen[:, :2] + radii[:, None]).max(0)
    scale = size / max((high - low).max(), 1e-9)
    depth = (seen[:, 2] - seen[:, 2].min()) / max(np.ptp(seen[:, 2]), 1e-9)
    parts = [f'<svg class="link" viewBox="0 0 {size} {size}">']
    margin = 0.5 * (size - scale * (high - low))
    for i in np.argsort(-seen[:, 2]):
        x = margin[0] + scale * (seen[i, 0] - low[0])
        y = size - margin[1] - scale * (seen[i, 1] - low[1])
        light = int(78 - 38 * depth[i])
        parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{max(scale * radii[i], 0.4):.1f}" '
                     f'fill="hsl(210 45% {light}%)" stroke="hsl(210 45% {light - 12}%)" '
                     'stroke-width=".4"/>')
    return ''.join(parts) + '</svg>'
