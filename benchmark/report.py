#!/usr/bin/env python3
"""Makes the tables and plots of the numbers that scripts/benchmark measured. Needs Python only.

Writes CSV files (with commit and machine) and plots to FOLDER, and the tables of FOLDER/benchmark.md and
of the README: the lines between the markers `<!-- NAME -->` and `<!-- end of NAME -->`.
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


FREE = "free_frame_us"  # where no link is in contact


def frame(row, measured="frame_us"):
    """[us] of work between two images."""
    query = "free_query_us" if measured == FREE else "query_us"
    return row[measured] or row["ingest_us"] + QUERIES_PER_FRAME * row[query]


def table(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def short_table(rows):
    keep = [r for r in rows
            if r["kind"] != "ours" or (r["max_error_mm"] == 5 and r["tolerance_mm"] < 5)]
    keep.sort(key=lambda r: (r["kind"] != "ours", r["tolerance_mm"], worst(r) >= 0.01,
                             r["free_query_us"]))
    return table(["method", "ingest", "query, median, out of contact", "in all configurations",
                  "motion at 1 kHz, median / p99", "one 30 Hz frame", "worst error"],
                 [[label(r), time(r["ingest_us"]), time(r["free_query_us"]), time(r["query_us"]),
                   f"{time(r['motion_us'])} / {time(r['motion_p99_us'])}" if r["motion_queries"] else "",
                   time(frame(r)), "0" if worst(r) < 0.01 else f"{worst(r):.2g} mm"] for r in keep])


def hard_table(rows):
    """Warm median / 99th percentile and the first query after an image, with most points. Primitives are in the CSV."""
    most = max(r["points"] for r in rows)
    cell = {(r["scene"], r["link"], r["noise_mm"], r["tolerance_mm"], r["asked"]): r for r in rows
            if r["points"] in (0, most)}

    def warm(*key):
        r = cell.get((*key, "warm"))
        return f"{time(r['median_us'])} / {time(r['p99_us'])}" if r else ""

    def new(*key):
        r = cell.get((*key, "new image"))
        return time(r["median_us"]) if r else ""
    return table(["scene", "link", "to 1 mm", "with noise of 1 mm", "new image", "exact, no noise"],
                 [[*source, warm(*source, 0, 1), warm(*source, 1, 1),
                   new(*source, 1, 1) or new(*source, 0, 1), warm(*source, 0, 0)]
                  for source in sources(rows) if " " in source[1] or source[1] == "bellows"])


def sources(rows):
    """The scenes with their links, in the order of the file."""
    return list(dict.fromkeys((r["scene"], r["link"]) for r in rows))


def checks(rows, keys):
    """The answers that were checked, once for each setting."""
    once = {tuple(r.get(k) for k in keys): r for r in rows}.values()
    checked, wrong = (sum(r[k] for r in once) for k in ("checked", "wrong"))
    return f"{checked:,.0f} answers were checked by brute force; {wrong:,.0f} were wrong.\n"


def deadline_table(rows):
    """Of whole robots; their scenes are added up, widths are the worst."""
    def percent(part, whole):
        return f"{100 * part / whole:.0f} %" if whole else ""
    lines = []
    for link in dict.fromkeys(r["link"] for r in rows if r["link"].startswith(("Panda", "demo"))):
        for asked in ("warm", "new image", "cold"):
            of = [r for r in rows if (r["link"], r["asked"]) == (link, asked)]
            line = [link, asked]
            for share in (0.1, 0.25, 0.5):
                at = [r for r in of if r["share"] == share]
                add = {k: sum(r[k] for r in at) for k in ("proven_free", "free_links", "unknown", "links")}
                width = max((r["width_mm"] for r in at), default=math.inf)
                line.append(f"{percent(add['proven_free'], add['free_links'])} / "
                            f"{percent(add['unknown'], add['links'])} / "
                            f"{'∞' if math.isinf(width) else f'{width:.3g}'}")
            lines.append(line + [time(max((r["overrun_max_us"] for r in of), default=0.0))])
    wrong, stopped = (sum(r[k] for r in rows) for k in ("wrong", "stopped"))
    return (table(["robot", "asked", "10 %", "25 %", "50 %", "overrun, largest"], lines) +
            f"\nOf {stopped:,.0f} stopped queries, single bodies included, {wrong:,.0f} had a wrong bound.\n")


class Plot:
    """Speed against error, both axes logarithmic, as SVG."""

    WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 860, 520, 80, 30, 40, 60
    COLOURS = {"ours": "#c0392b", "exact": "#2c3e50", "spheres": "#2980b9", "grid": "#8e44ad"}
    FLOOR_MM = 0.01  # exact to float: drawn here

    def __init__(self, rows, title):
        self.rows, self.title, self.parts = rows, title, []
        times = [r["free_query_us"] for r in self.rows]
        self.y = (math.floor(math.log10(min(times))), math.ceil(math.log10(max(times))))
        self.x = (math.log10(self.FLOOR_MM) - 0.3, 3.0)  # room for labels

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


def report_hard(arguments, run):
    hard, near, deadline = (read(path) for path in arguments.results)
    for name, rows in (("hard", hard), ("near", near), ("deadline", deadline)):
        if rows:
            write(arguments.folder / f"benchmark_{name}.csv", rows, arguments)
    parts = {"benchmark hard run": run, "benchmark hard": hard_table(hard),
             "benchmark hard checks": checks(hard + near, (
                 "scene", "link", "points", "noise_mm", "robot", "distance_mm", "tolerance_mm")),
             "benchmark deadline": deadline_table(deadline)}
    fill(arguments.folder / "benchmark.md", parts)


def report_peers(arguments, run):
    peers = read(arguments.results[0])
    write(arguments.folder / "benchmark.csv", peers, arguments)
    shown = [r for r in peers if r["data"] == "kinect"] or peers
    parts = {"benchmark run": run, "benchmark short": short_table(shown)}
    fill(arguments.folder / "benchmark.md", parts)
    title = f"Speed against error: {NAMES[shown[0]['data']]}, {arguments.commit}"
    (arguments.folder / "benchmark.svg").write_text(Plot(shown, title).svg(), encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kind", choices=("peers", "hard", "camera"))
    parser.add_argument("results", type=Path, nargs="+",
                        help="peers: one CSV; hard: three CSV; camera: tables. Tables are in "
                             "Markdown, each after a line '# NAME'")
    for name in ("commit", "machine", "date"):
        parser.add_argument("--" + name, required=True)
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--readme", type=Path)
    arguments = parser.parse_args()
    run = f"Commit {arguments.commit}, {arguments.date}, {arguments.machine}.\n"
    if arguments.kind == "peers":
        report_peers(arguments, run)
    elif arguments.kind == "hard":
        report_hard(arguments, run)
    else:
        parts = {**sections(arguments.results[0]), "benchmark camera run": run}
        fill(arguments.folder / "benchmark.md", parts)
        if arguments.readme:
            fill(arguments.readme, parts)


if __name__ == "__main__":
    main()
