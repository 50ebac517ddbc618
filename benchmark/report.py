#!/usr/bin/env python3
"""Makes the tables and plots of the numbers that scripts/benchmark measured. Needs Python only.

Writes CSV files (with commit and machine) and a plot to FOLDER, and the tables of FOLDER/benchmark.md:
the lines between the markers `<!-- NAME -->` and `<!-- end of NAME -->`.
"""

import argparse
import csv
import math
import re
import sys
from pathlib import Path
from xml.sax.saxutils import escape

RUNS = {"peers": "benchmark run", "hard": "benchmark hard run", "camera": "benchmark camera run",
        "ros": "ros run"}
NAMES = {"kinect": "Kinect frames", "synthetic": "Synthetic scene"}


def read(path):
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    if not rows:
        sys.exit(f"{path} has no rows: nothing was measured")
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
                   time(r["frame_us"]), "0" if worst(r) < 0.01 else f"{worst(r):.2g} mm"] for r in keep])


def hard_table(rows):
    """Warm median / 99th percentile and the first query after an image."""
    cell = {(r["scene"], r["link"], r["noise_mm"], r["tolerance_mm"], r["asked"]): r for r in rows}

    def warm(*key):
        r = cell.get((*key, "warm"))
        return f"{time(r['median_us'])} / {time(r['p99_us'])}" if r else ""

    def new(*key):
        r = cell.get((*key, "new image"))
        return time(r["median_us"]) if r else ""
    sources = dict.fromkeys((r["scene"], r["link"]) for r in rows)
    return table(["scene", "link", "to 1 mm", "with noise of 1 mm", "new image", "exact, no noise"],
                 [[*source, warm(*source, 0, 1), warm(*source, 1, 1),
                   new(*source, 1, 1) or new(*source, 0, 1), warm(*source, 0, 0)] for source in sources])


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
            f"\nOf {stopped:,.0f} stopped queries {wrong:,.0f} had a wrong bound.\n")


class Plot:
    """Speed against error, both axes logarithmic, as SVG."""

    WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 860, 520, 80, 830, 40, 460
    COLOURS = {"ours": "#c0392b", "exact": "#2c3e50", "spheres": "#2980b9", "grid": "#8e44ad"}
    FLOOR_MM = 0.01  # exact to float: drawn here

    def __init__(self, rows, title):
        self.parts = []
        times = [math.log10(r["free_query_us"]) for r in rows]
        self.decades = (math.floor(min(times)), math.ceil(max(times)))
        self.axes(title)
        self.front([r for r in rows if r["kind"] == "ours"])
        self.peers(sorted((r for r in rows if r["kind"] != "ours"), key=lambda r: r["free_query_us"]))

    def x(self, mm):
        low, high = math.log10(self.FLOOR_MM) - 0.3, 3.0  # room for labels
        share = (math.log10(max(mm, self.FLOOR_MM)) - low) / (high - low)
        return self.LEFT + share * (self.RIGHT - self.LEFT)

    def y(self, us):
        low, high = self.decades
        return self.BOTTOM - (math.log10(us) - low) / (high - low) * (self.BOTTOM - self.TOP)

    def place(self, row):
        return self.x(worst(row)), self.y(row["free_query_us"])

    def text(self, x, y, words, anchor="middle", colour="#333", extra=""):
        self.parts.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{colour}"'
                          f'{extra}>{escape(words)}</text>')

    def path(self, points, colour, width=1):
        steps = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        self.parts.append(f'<polyline points="{steps}" fill="none" stroke="{colour}" '
                          f'stroke-width="{width}"/>')

    def dot(self, row, radius):
        x, y = self.place(row)
        self.parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" '
                          f'fill="{self.COLOURS[row["kind"]]}"/>')

    def axes(self, title):
        for decade in range(self.decades[0], self.decades[1] + 1):
            y = self.y(10.0 ** decade)
            self.path([(self.LEFT, y), (self.RIGHT, y)], "#ddd")
            self.text(self.LEFT - 8, y + 4, time(10.0 ** decade).replace(".0", ""), "end")
        for mm, words in ((0.01, "exact"), (0.1, "0.1 mm"), (1, "1 mm"), (10, "10 mm"), (100, "100 mm"),
                          (1000, "1 m")):
            self.path([(self.x(mm), self.TOP), (self.x(mm), self.BOTTOM)], "#ddd")
            self.text(self.x(mm), self.BOTTOM + 18, words)
        middle = (self.LEFT + self.RIGHT) / 2
        self.text(middle, self.HEIGHT - 14, "largest error of a link's distance")
        self.text(20, 250, "query of all links, out of contact: median, one thread",
                  extra=' transform="rotate(-90 20 250)"')
        self.text(middle, 22, title, extra=' font-weight="bold"')

    def front(self, ours):
        fastest = {}  # for each tolerance
        for r in sorted(ours, key=lambda r: (r["tolerance_mm"], r["free_query_us"])):
            self.dot(r, 3)
            fastest.setdefault(r["tolerance_mm"], r)
        places = [self.place(r) for r in fastest.values()]
        self.path(places, self.COLOURS["ours"], 2)
        self.text(places[0][0] + 10, places[0][1] + 44,
                  "ist_proximity: tolerance 0, 1, 5, 20 mm; packed to 10, 5, 2 mm", "start",
                  self.COLOURS["ours"])

    def peers(self, rows):
        taken = []  # places of labels, so that none lies on another
        for r in rows:
            x, y = self.place(r)
            self.dot(r, 5)
            at = y + 4
            while any(abs(at - other) < 14 and abs(x - place) < 200 for place, other in taken):
                at -= 14
            taken.append((x, at))
            self.text(x + 9, at, label(r), "start", self.COLOURS[r["kind"]])

    def svg(self):
        return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self.WIDTH} {self.HEIGHT}" '
                'font-family="sans-serif" font-size="12">\n'
                '<rect width="100%" height="100%" fill="white"/>\n' + "\n".join(self.parts) +
                "\n</svg>\n")


def fill(path, parts):
    """Replaces the text between the markers. Markers that the document lacks are skipped."""
    text = path.read_text(encoding="utf-8")
    for name, content in parts.items():
        begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
        text = re.sub(re.escape(begin) + ".*?" + re.escape(end),
                      lambda _, part=begin + content + end: part, text, flags=re.DOTALL)
    path.write_text(text, encoding="utf-8")


def near_sentence(rows):
    at = {r["distance_mm"]: f"{time(r['median_us'])} / {time(r['p99_us'])}" for r in rows
          if (r["robot"], r["tolerance_mm"], r["asked"]) == ("Panda, visual meshes", 1, "warm")}
    return f"A Panda 1 mm deep in the table takes {at[-1]} to 1 mm, {at[300]} at 300 mm.\n"


def report_hard(arguments):
    rows = {name: read(arguments.folder / f"{name}.csv") for name in ("hard", "near", "deadline")}
    for name in filter(rows.get, rows):
        write(arguments.folder / f"benchmark_{name}.csv", rows[name], arguments)
    return {"benchmark hard": hard_table(rows["hard"]),
            "benchmark hard checks": checks(rows["hard"] + rows["near"], (
                "scene", "link", "noise_mm", "robot", "distance_mm", "tolerance_mm")),
            "benchmark near": near_sentence(rows["near"]),
            "benchmark deadline": deadline_table(rows["deadline"])}


def report_peers(arguments):
    peers = read(arguments.folder / "peers.csv")
    write(arguments.folder / "benchmark.csv", peers, arguments)
    shown = [r for r in peers if r["data"] == "kinect"] or peers
    plot = Plot(shown, f"Speed against error: {NAMES[shown[0]['data']]}, {arguments.commit}")
    (arguments.folder / "benchmark.svg").write_text(plot.svg(), encoding="utf-8")
    return {"benchmark short": short_table(shown)}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kind", choices=RUNS, help="peers and hard: the CSV files are in FOLDER")
    for name in ("commit", "machine", "date"):
        parser.add_argument("--" + name, required=True)
    parser.add_argument("--folder", type=Path, required=True)
    arguments = parser.parse_args()
    parts = {RUNS[arguments.kind]: f"Commit {arguments.commit}, {arguments.date}, {arguments.machine}.\n"}
    if arguments.kind in ("peers", "hard"):
        parts.update(report_peers(arguments) if arguments.kind == "peers" else report_hard(arguments))
    fill(arguments.folder / "benchmark.md", parts)


if __name__ == "__main__":
    main()
