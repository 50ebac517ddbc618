#!/usr/bin/env python3
"""Makes the tables and plots of the numbers that scripts/benchmark measured. Needs Python only.

Writes FOLDER/benchmark.csv and benchmark_growth.csv (with commit and machine), the plots
FOLDER/benchmark.svg and benchmark_growth.svg, and the tables of FOLDER/benchmark.md and of the
README: the lines between the markers `<!-- NAME -->` and `<!-- end of NAME -->`.
"""

import argparse
import csv
import math
import re
from pathlib import Path
from xml.sax.saxutils import escape

QUERIES_PER_FRAME = 33  # 1 kHz between two images at 30 Hz
NAMES = {"kinect": "Kinect frames", "synthetic": "Synthetic scene"}


def read(path):
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        for key, value in row.items():
            try:
                row[key] = float(value)
            except ValueError:
                pass
    return rows


def write(path, rows, arguments):
    """Adds where and when to every row."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        extra = {"commit": arguments.commit, "machine": arguments.machine, "date": arguments.date}
        writer = csv.DictWriter(file, [*extra, *rows[0]], lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({**extra, **{k: f"{v:g}" if isinstance(v, float) else v
                                         for k, v in row.items()}})


def time(us):
    """Microseconds for a reader: three digits."""
    if us >= 1e4:
        return f"{us / 1e3:,.0f} ms"
    if us >= 1e3:
        return f"{us / 1e3:.1f} ms"
    return f"{us:.0f} µs" if us >= 10 else f"{us:.1f} µs"


def label(row):
    if row["kind"] == "ours":
        tolerance = "exact" if row["tolerance_mm"] == 0 else f"to {row['tolerance_mm']:g} mm"
        return f"**ist_proximity, {tolerance}**, packed to {row['max_error_mm']:g} mm"
    spheres = f", {row['spheres']:.0f} spheres" if row["spheres"] else ""
    return row["method"] + spheres


def worst(row):
    return max(-row["error_least_mm"], row["error_largest_mm"])


def number(value):
    if abs(value) < 1e-3:
        return "0"
    return f"{value:.2g}" if abs(value) < 10 else f"{value:.0f}"


def error(row):
    """[mm] mean and both ends; what float rounds is not worth its digits."""
    if worst(row) < 0.01:
        return "0"
    return (f"{number(row['error_mean_mm'])} "
            f"({number(row['error_least_mm'])} … {number(row['error_largest_mm'])})")


FREE = "free_frame_us"  # where no link is in contact


def frame(row, measured="frame_us"):
    """[us] of work between two images."""
    query = "free_query_us" if measured == FREE else "query_us"
    return row[measured] or row["ingest_us"] + QUERIES_PER_FRAME * row[query]


def table(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def times(row, what):
    return " / ".join(time(row[f"{what}_{k}"]) for k in ("us", "p99_us", "max_us"))


def peers_table(rows):
    return table(
        ["method", "ingest", "query, median / p99 / largest",
         "no link in contact, median / p99 / largest",
         "error mean (least … largest) [mm]", "one 30 Hz frame, median / p99 / largest"],
        [[label(r), time(r["ingest_us"])] + (["", "", "", ""] if r["kind"] == "floor" else [
            times(r, "query"), times(r, "free_query"),
            error(r), times(r, "frame") if r["frame_us"] else time(frame(r))]) for r in rows])


def short_table(rows):
    keep = [r for r in rows if r["kind"] not in ("ours", "floor")
            or (r["kind"] == "ours" and r["max_error_mm"] == 5 and r["tolerance_mm"] < 20)]
    keep.sort(key=lambda r: (r["kind"] != "ours", r["tolerance_mm"], worst(r) >= 0.01,
                             r["free_query_us"]))
    return table(["method", "ingest", "query, median, out of contact", "in all configurations",
                  "worst error"],
                 [[label(r), time(r["ingest_us"]), time(r["free_query_us"]), time(r["query_us"]),
                   "0" if worst(r) < 0.01 else f"{worst(r):.2g} mm"] for r in keep])


def motion_table(rows):
    return table(
        ["method", "queries", "median", "p99", "largest", "p99 / median", "largest / median",
         "no contact: median", "p99", "largest", "first after an image: median / p99 / largest"],
        [[label(r), f"{r['motion_queries']:.0f}", time(r["motion_us"]), time(r["motion_p99_us"]),
          time(r["motion_max_us"]), f"{r['motion_p99_us'] / r['motion_us']:.1f}",
          f"{r['motion_max_us'] / r['motion_us']:.1f}"] +
         [time(r[f"free_motion_{k}"]) if r["free_motion_us"] else ""
          for k in ("us", "p99_us", "max_us")] +
         [times(r, "first") if r["first_us"] else ""]
         for r in rows if r["motion_queries"]])


def growth_table(rows, what, unit):
    chosen = [r for r in rows if r["what"] == what]
    values = sorted({r["value"] for r in chosen})
    cell = {(r["value"], r["tolerance_mm"]): f"{time(r['query_us'])} / {time(r['query_p99_us'])}"
            for r in chosen}
    return table([f"{what}{unit}", "to 1 mm, median / p99", "exact, median / p99"],
                 [[f"{v:,.0f}" if v > 2 or v == int(v) else f"{v:g}", cell[v, 1.0], cell[v, 0.0]]
                  for v in values])


def best(rows, *, kinds, key):
    chosen = [r for r in rows if r["kind"] in kinds]
    return min(chosen, key=key) if chosen else None


def ratios(rows):
    """What the project set itself as goals: one row each."""
    by = {(r["max_error_mm"], r["tolerance_mm"]): r for r in rows if r["kind"] == "ours"}
    exact, coarse = by[5.0, 0.0], by[5.0, 1.0]
    named = {}
    for r in rows:  # the first of a name: nanoflann on all points, not on voxels
        named.setdefault(r["method"].split(",")[0].split(" ")[0] + r["kind"], r)
    lines = []

    def line(text, goal, free, everything=None):
        lines.append([text, f"{free:.3g}", f"{everything:.3g}" if everything else "", goal])

    memcpy = next(r for r in rows if r["kind"] == "floor")
    line("ingest of 640×480 / memcpy of the frame", "≤ 2.5",
         exact["ingest_us"] / memcpy["ingest_us"])
    for peer, kind, ours, text, goal, percentile in (
            ("Embree point query, hierarchy", "exact", exact, "exact, median query", "≥ 20", ""),
            ("Embree point query, hierarchy", "exact", coarse, "to 1 mm, median query", "≥ 40", ""),
            ("Embree point query, link boxes", "exact", exact, "exact, median query", "≥ 30", ""),
            ("FCL", "exact", exact, "exact, median query", "≥ 20", ""),
            ("signed distance grid", "grid", coarse, "to 1 mm, median query", "≥ 3", ""),
            ("signed distance grid", "grid", coarse, "to 1 mm, 99th percentile", "≥ 1", "p99_")):
        rival = next((r for r in rows if r["kind"] == kind and r["method"].startswith(peer)), None)
        if rival:
            line(f"{rival['method'].split(' (')[0]} / ours, {text}", goal,
                 *(rival[f"{k}_{percentile}us"] / ours[f"{k}_{percentile}us"]
                   for k in ("free_query", "query")))
    rival = best(rows, kinds=("exact",), key=frame)
    if rival:
        line(f"work per 30 Hz frame: {rival['method']} / ours, exact",
             "≥ 50", frame(rival, FREE) / frame(exact, FREE), frame(rival) / frame(exact))
    if "nanoflannspheres" in named:
        line("work per 30 Hz frame: nanoflann on all points / ours to 1 mm",
             "≥ 5", frame(named["nanoflannspheres"], FREE) / frame(coarse, FREE),
             frame(named["nanoflannspheres"]) / frame(coarse))
    for key, text, goal in (("p99_us", "p99", "≤ 3"), ("max_us", "largest", "≤ 10")):
        line(f"motion, exact: {text} / median", goal,
             exact[f"free_motion_{key}"] / exact["free_motion_us"],
             exact[f"motion_{key}"] / exact["motion_us"])
    return table(["what", "out of contact", "all", "goal"], lines)


class Drawing:
    """Parts of an SVG, with a logarithmic axis of times upwards. What derives from it has the sizes
    and `y`, the range of the times' decimal logarithms."""

    def __init__(self, rows, title):
        self.rows = rows
        self.title = title
        self.parts = []

    def py(self, us):
        share = (math.log10(us) - self.y[0]) / (self.y[1] - self.y[0])
        return self.HEIGHT - self.BOTTOM - share * (self.HEIGHT - self.TOP - self.BOTTOM)

    def text(self, x, y, words, anchor="middle", colour="#333", extra=""):
        self.parts.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{colour}"'
                          f'{extra}>{escape(words)}</text>')

    def whole(self):
        return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self.WIDTH} {self.HEIGHT}" '
                'font-family="sans-serif" font-size="12">\n'
                '<rect width="100%" height="100%" fill="white"/>\n' + "\n".join(self.parts) +
                "\n</svg>\n")


class Plot(Drawing):
    """Speed against error, both axes logarithmic."""

    WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 860, 520, 80, 30, 40, 60
    COLOURS = {"ours": "#c0392b", "exact": "#2c3e50", "spheres": "#2980b9", "grid": "#8e44ad"}
    FLOOR_MM = 0.01  # exact to float: drawn here

    def __init__(self, rows, title):
        super().__init__([r for r in rows if r["kind"] != "floor"], title)
        times = [r["free_query_us"] for r in self.rows]
        self.y = (math.floor(math.log10(min(times))), math.ceil(math.log10(max(times))))
        self.x = (math.log10(self.FLOOR_MM) - 0.3, 3.0)  # room for labels

    def px(self, mm):
        share = (math.log10(max(mm, self.FLOOR_MM)) - self.x[0]) / (self.x[1] - self.x[0])
        return self.LEFT + share * (self.WIDTH - self.LEFT - self.RIGHT)

    def line(self, x1, y1, x2, y2, colour):
        self.parts.append(f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" '
                          f'stroke="{colour}"/>')

    def axes(self):
        left, right = self.LEFT, self.WIDTH - self.RIGHT
        bottom = self.HEIGHT - self.BOTTOM
        for decade in range(self.y[0], self.y[1] + 1):
            y = self.py(10.0 ** decade)
            self.line(left, y, right, y, "#ddd")
            self.text(left - 8, y + 4, time(10.0 ** decade).replace(".0", ""), "end")
        for decade in range(-2, 4):
            x = self.px(10.0 ** decade)
            self.line(x, self.TOP, x, bottom, "#ddd")
            self.text(x, bottom + 18,
                      "exact" if decade == -2 else "1 m" if decade == 3 else f"{10.0 ** decade:g} mm")
        self.text((left + right) / 2, self.HEIGHT - 14, "largest error of a link's distance")
        self.text(20, (self.TOP + bottom) / 2, "query of all links, out of contact: median, one thread",
                  extra=f' transform="rotate(-90 20 {(self.TOP + bottom) / 2:.0f})"')
        self.text((left + right) / 2, 22, self.title, extra=' font-weight="bold"')

    def front(self):
        ours = [r for r in self.rows if r["kind"] == "ours"]
        colour = self.COLOURS["ours"]
        for r in ours:
            self.dot(r, colour, 3)
        steps, fastest = [], {}
        for r in ours:  # the fastest for each tolerance
            t = r["tolerance_mm"]
            if t not in fastest or r["free_query_us"] < fastest[t]["free_query_us"]:
                fastest[t] = r
        for _, r in sorted(fastest.items()):
            steps.append(f"{self.px(worst(r)):.1f},{self.py(r['free_query_us']):.1f}")
        self.parts.append(f'<polyline points="{" ".join(steps)}" fill="none" stroke="{colour}" '
                          'stroke-width="2"/>')
        first = fastest[min(fastest)]
        self.text(self.px(worst(first)) + 10, self.py(first["free_query_us"]) + 44,
                  "ist_proximity: tolerance 0, 1, 5, 20 mm; packed to 10, 5, 2 mm", "start",
                  colour)

    def dot(self, row, colour, radius):
        self.parts.append(f'<circle cx="{self.px(worst(row)):.1f}" cy="{self.py(row["free_query_us"]):.1f}" '
                          f'r="{radius}" fill="{colour}"/>')

    def peers(self):
        taken = []  # heights of labels, so that none lies on another
        for r in sorted((r for r in self.rows if r["kind"] != "ours"), key=lambda r: r["free_query_us"]):
            colour = self.COLOURS[r["kind"]]
            x, y = self.px(worst(r)), self.py(r["free_query_us"])
            self.dot(r, colour, 5)
            at = y + 4
            while any(abs(at - other) < 14 and abs(x - place) < 200 for place, other in taken):
                at -= 14
            taken.append((x, at))
            self.text(x + 9, at, label(r), "start", colour)

    def svg(self):
        self.axes()
        self.front()
        self.peers()
        return self.whole()


class GrowthPlot(Drawing):
    """Median and 99th percentile of a query against what grows: four panels, axes logarithmic."""

    WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM, GAP = 860, 330, 70, 20, 60, 50, 22
    PANELS = (("spheres", "spheres"), ("points", "points"), ("links", "links"),
              ("distance", "distance [m]"))
    COLOURS = {0.0: ("exact", "#c0392b"), 1.0: ("to 1 mm", "#2980b9")}  # by tolerance [mm]

    def __init__(self, rows, title):
        super().__init__(rows, title)
        times = [r[key] for r in rows for key in ("query_us", "query_p99_us")]
        self.y = (math.log10(min(times)) - 0.1, math.log10(max(times)) + 0.1)

    def line(self, points, colour, extra=""):
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        self.parts.append(f'<polyline points="{path}" fill="none" stroke="{colour}"{extra}/>')

    def panel(self, number, what, words):
        width = (self.WIDTH - self.LEFT - self.RIGHT) / len(self.PANELS)
        left, right = self.LEFT + number * width, self.LEFT + (number + 1) * width - self.GAP
        rows = [r for r in self.rows if r["what"] == what]
        values = sorted({r["value"] for r in rows})
        low, high = math.log10(values[0]), math.log10(values[-1])
        bottom = self.HEIGHT - self.BOTTOM

        def px(value):
            return left + (math.log10(value) - low) / (high - low) * (right - left)

        for decade in range(math.ceil(self.y[0]), math.floor(self.y[1]) + 1):
            y = self.py(10.0 ** decade)
            self.line([(left, y), (right, y)], "#ddd")
            if number == 0:
                self.text(left - 8, y + 4, time(10.0 ** decade).replace(".0", ""), "end")
        for value in (values[0], values[-1]):
            self.line([(px(value), self.TOP), (px(value), bottom)], "#ddd")
            anchor = "start" if value == values[0] else "end"
            self.text(px(value), bottom + 18, f"{value:,.0f}" if value >= 1 else f"{value:g}",
                      anchor)
        self.text((left + right) / 2, self.HEIGHT - 12, words)
        for tolerance, (_, colour) in self.COLOURS.items():
            of = sorted((r for r in rows if r["tolerance_mm"] == tolerance),
                        key=lambda r: r["value"])
            self.line([(px(r["value"]), self.py(r["query_us"])) for r in of], colour,
                      ' stroke-width="2"')
            self.line([(px(r["value"]), self.py(r["query_p99_us"])) for r in of], colour,
                      ' stroke-dasharray="3 3"')

    def svg(self):
        for number, (what, words) in enumerate(self.PANELS):
            self.panel(number, what, words)
        self.text(self.WIDTH / 2, 22, self.title, extra=' font-weight="bold"')
        for number, (words, colour) in enumerate(self.COLOURS.values()):
            self.text(self.LEFT + 270 * number, 44, f"{words}: median (99th percentile dashed)",
                      "start", colour)
        return self.whole()


def fill(path, parts):
    """Replaces the text between the markers. Markers that the document lacks are skipped."""
    text = path.read_text(encoding="utf-8")
    for name, content in parts.items():
        begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
        text = re.sub(re.escape(begin) + ".*?" + re.escape(end),
                      lambda _, part=begin + content + end: part, text, flags=re.DOTALL)
    path.write_text(text, encoding="utf-8")


def sections(path):
    """Tables in Markdown, each after a line '# NAME'."""
    parts = {}
    for section in path.read_text(encoding="utf-8").split("# ")[1:]:
        name, content = section.split("\n", 1)
        parts[f"benchmark {name}"] = content.rstrip("\n") + "\n"
    return parts


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", type=Path, metavar="TABLES",
                        help="only these tables, in Markdown, each after a line '# NAME'")
    parser.add_argument("peers", type=Path, nargs="?")
    parser.add_argument("growth", type=Path, nargs="?")
    parser.add_argument("ingest", type=Path, nargs="?", help="a table in Markdown")
    parser.add_argument("modes", type=Path, nargs="?",
                        help="tables in Markdown, each after a line '# NAME'")
    for name in ("commit", "machine", "date"):
        parser.add_argument("--" + name, required=True)
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--readme", type=Path)
    arguments = parser.parse_args()
    if arguments.only:
        run = f"Commit {arguments.commit}, {arguments.date}, {arguments.machine}.\n"
        parts = {**sections(arguments.only), "benchmark camera run": run}
        fill(arguments.folder / "benchmark.md", parts)
        if arguments.readme:
            fill(arguments.readme, parts)
        return

    peers, growth = read(arguments.peers), read(arguments.growth)
    write(arguments.folder / "benchmark.csv", peers, arguments)
    write(arguments.folder / "benchmark_growth.csv", growth, arguments)
    parts = {"benchmark run": f"Commit {arguments.commit}, {arguments.date}, {arguments.machine}.\n"}
    sets = {name: [r for r in peers if r["data"] == name] for name in NAMES}
    for name, rows in sets.items():
        if rows:
            parts[f"benchmark {name}"] = peers_table(rows)
            parts[f"benchmark motion {name}"] = motion_table(rows)
    shown = sets["kinect"] or sets["synthetic"]
    parts["benchmark ingest"] = arguments.ingest.read_text(encoding="utf-8")
    parts.update(sections(arguments.modes))
    parts["benchmark ratios"] = ratios(shown)
    parts["benchmark short"] = short_table(shown)
    for what, unit in (("spheres", ""), ("points", ""), ("links", ""), ("distance", " [m]")):
        parts[f"benchmark {what}"] = growth_table(growth, what, unit)
    fill(arguments.folder / "benchmark.md", parts)
    if arguments.readme:
        fill(arguments.readme, parts)
    title = f"Speed against error: {NAMES[shown[0]['data']]}, {arguments.commit}"
    (arguments.folder / "benchmark.svg").write_text(Plot(shown, title).svg(), encoding="utf-8")
    (arguments.folder / "benchmark_growth.svg").write_text(
        GrowthPlot(growth, f"Time of a query as things grow, {arguments.commit}").svg(),
        encoding="utf-8")


if __name__ == "__main__":
    main()
