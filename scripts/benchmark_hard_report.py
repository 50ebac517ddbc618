#!/usr/bin/env python3
"""Makes the tables and the plot of what `scripts/benchmark --hard` measured. Needs Python only.

Writes FOLDER/benchmark_hard.csv, benchmark_near.csv and benchmark_deadline.csv (with commit and
machine), the plot FOLDER/benchmark_deadline.svg, and the tables of FOLDER/benchmark.md.
"""

import argparse
import math
from pathlib import Path

from benchmark_report import Drawing, fill, read, table, time, write

FREE_MM = 300  # the nearest link's distance that counts as free space
SHARES = (0.1, 0.25, 0.5)


def sources(rows):
    """The scenes with their links, in the order of the file."""
    return list(dict.fromkeys((r["scene"], r["link"]) for r in rows))


def three(rows):
    """Warm median / 99th percentile / largest cold one, of the rows of one setting."""
    by = {r["asked"]: r for r in rows}
    if "warm" not in by or "cold" not in by:
        return ""
    warm = by["warm"]
    return f"{time(warm['median_us'])} / {time(warm['p99_us'])} / {time(by['cold']['max_us'])}"


def hard_table(rows, tolerance_mm):
    rows = [r for r in rows if r["tolerance_mm"] == tolerance_mm]
    sizes = sorted({r["points"] for r in rows if r["points"]})
    noises = sorted({r["noise_mm"] for r in rows if r["points"]})
    columns = [(n, noises[0]) for n in sizes] + [(sizes[-1], noise) for noise in noises[1:]]
    lines = []
    for scene, link in sources(rows):
        of = [r for r in rows if (r["scene"], r["link"]) == (scene, link)]
        if not any(r["points"] for r in of):  # recorded: one size, one noise
            lines.append([scene, link, three(of)] + [""] * (len(columns) - 1))
            continue
        lines.append([scene, link] + [three([r for r in of if (r["points"], r["noise_mm"]) == c])
                                      for c in columns])
    header = [f"{n:,.0f} points" + (f", noise {noise:g} mm" if noise else "")
              for n, noise in columns]
    return table(["scene", "link"] + header, lines)


def again_table(rows, tolerance_mm):
    """How a query comes about, with most points; the medians."""
    kinds = list(dict.fromkeys(r["asked"] for r in rows))
    most = max(r["points"] for r in rows)
    lines = []
    for scene, link in sources(rows):
        of = {(r["noise_mm"], r["asked"]): r for r in rows
              if (r["scene"], r["link"], r["tolerance_mm"]) == (scene, link, tolerance_mm)
              and r["points"] in (0, most)}
        for noise in sorted({noise for noise, _ in of}):
            if noise in (0, 1):
                lines.append([scene, link, f"{noise:g}" if of[noise, kinds[0]]["points"] else ""] +
                             [time(of[noise, k]["median_us"]) if (noise, k) in of else ""
                              for k in kinds] + [f"{of[noise, kinds[0]]['evaluations']:,.0f}"])
    return table(["scene", "link", "noise [mm]", *kinds, "exact evaluations, warm"], lines)


def checks(rows, keys):
    """The answers that were checked, once for each setting."""
    once = {tuple(r[k] for k in keys): r for r in rows}.values()
    checked, wrong = (sum(r[k] for r in once) for k in ("checked", "wrong"))
    return f"{checked:,.0f} answers were checked by brute force; {wrong:,.0f} were wrong.\n"


def near_table(rows, tolerance_mm):
    rows = [r for r in rows if r["tolerance_mm"] == tolerance_mm]
    cell = {(r["robot"], r["distance_mm"], r["asked"]): r for r in rows}
    lines = []
    for robot in dict.fromkeys(r["robot"] for r in rows):
        free = cell.get((robot, FREE_MM, "warm"))
        for distance in dict.fromkeys(r["distance_mm"] for r in rows if r["robot"] == robot):
            warm = cell[robot, distance, "warm"]
            where = f"{distance:g} mm" if distance > 0 else f"{-distance:g} mm deep"

            def ratio(key, measured=warm, reference=free):
                return f"{measured[key] / reference[key]:.1f}" if reference else ""
            lines.append(
                [robot, where, f"{warm['queries']:.0f}", time(warm["median_us"]),
                 time(warm["p99_us"]), time(warm["max_us"]), ratio("median_us"), ratio("p99_us"),
                 ratio("max_us")] +
                [time(cell[robot, distance, k]["median_us"])
                 for k in ("same pose again", "new image", "new image, still", "cold")])
    return table(["robot", "nearest link", "queries", "median", "p99", "largest",
                  "median / free space's", "p99 / its p99", "largest / its largest",
                  "same pose again", "new image", "new image, still", "cold"], lines)


def percent(part, whole):
    return f"{100 * part / whole:.0f} %" if whole else ""


def millimetres(value):
    return "∞" if math.isinf(value) else f"{value:.3g}"


def deadline_table(rows):
    """One row for each scene and kind; settings of one scene are added up, widths are the worst."""
    lines = []
    for (scene, link) in sources(rows):
        for asked in ("warm", "new image", "cold"):
            of = [r for r in rows if (r["scene"], r["link"], r["asked"]) == (scene, link, asked)]
            line = [scene, link, asked]
            for share in SHARES:
                at = [r for r in of if r["share"] == share]
                add = {k: sum(r[k] for r in at) for k in ("proven_free", "free_links", "unknown",
                                                          "links")}
                line.append(f"{percent(add['proven_free'], add['free_links'])} / "
                            f"{percent(add['unknown'], add['links'])} / "
                            f"{millimetres(max(r['width_mm'] for r in at))}" if at else "")
            late = max((r["overrun_p999_us"] for r in of), default=0.0)
            latest = max((r["overrun_max_us"] for r in of), default=0.0)
            lines.append(line + [f"{time(late)} / {time(latest)}",
                                 f"{sum(r['wrong'] for r in of):.0f}"])
    return table(["scene", "link", "asked"] + [f"{100 * s:g} %" for s in SHARES] +
                 ["overrun p99.9 / largest", "wrong bounds"], lines)


class DeadlinePlot(Drawing):
    """Width of the bounds against the deadline: median and 90th percentile of the links."""

    WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM, GAP = 860, 360, 70, 20, 60, 50, 24
    COLOURS = {"warm": "#2980b9", "new image": "#8e44ad", "cold": "#c0392b"}
    UNKNOWN_MM = 2000.0  # drawn here

    def __init__(self, rows, scenes, title):
        super().__init__(rows, title)
        self.scenes = scenes
        widths = [r[k] for r in rows for k in ("width_mm", "width_p90_mm") if 0 < r[k] < math.inf]
        self.y = (math.log10(min(widths)) - 0.1, math.log10(self.UNKNOWN_MM) + 0.1)
        self.low = min(widths)

    def curve(self, points, colour, extra):
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        self.parts.append(f'<polyline points="{path}" fill="none" stroke="{colour}"{extra}/>')

    def height(self, mm):
        return self.py(min(max(mm, self.low), self.UNKNOWN_MM))

    def panel(self, number, scene):
        width = (self.WIDTH - self.LEFT - self.RIGHT) / len(self.scenes)
        left, right = self.LEFT + number * width, self.LEFT + (number + 1) * width - self.GAP
        bottom = self.HEIGHT - self.BOTTOM
        shares = sorted({r["share"] for r in self.rows})

        def px(share):
            return left + share / shares[-1] * (right - left)
        for decade in range(math.ceil(self.y[0]), math.floor(self.y[1]) + 1):
            y = self.py(10.0 ** decade)
            self.curve([(left, y), (right, y)], "#ddd", "")
            if number == 0:
                self.text(left - 8, y + 4, f"{10.0 ** decade:g} mm", "end")
        top = self.py(self.UNKNOWN_MM)
        self.curve([(left, top), (right, top)], "#aaa", ' stroke-dasharray="2 4"')
        if number == 0:
            self.text(left - 8, top + 4, "UNKNOWN", "end")
        for share in (0.1, 0.5, 1.0):
            self.curve([(px(share), self.TOP), (px(share), bottom)], "#eee", "")
            self.text(px(share), bottom + 18, f"{100 * share:g} %")
        self.text((left + right) / 2, self.HEIGHT - 10, scene[0])
        for asked, colour in self.COLOURS.items():
            of = sorted((r for r in self.rows
                         if (r["scene"], r["link"], r["asked"]) == (*scene, asked)),
                        key=lambda r: r["share"])
            for key, extra in (("width_mm", ' stroke-width="2"'),
                               ("width_p90_mm", ' stroke-dasharray="3 3"')):
                self.curve([(px(r["share"]), self.height(r[key])) for r in of], colour, extra)

    def svg(self):
        for number, scene in enumerate(self.scenes):
            self.panel(number, scene)
        self.text(self.WIDTH / 2, 22, self.title, extra=' font-weight="bold"')
        for number, (asked, colour) in enumerate(self.COLOURS.items()):
            self.text(self.LEFT + 360 * number, 44,
                      f"{asked}: median of the links (90th percentile dashed)", "start", colour)
        return self.whole()


def plotted(rows):
    """One setting of each scene: most points, noise 1 mm where it is there, the larger tolerance."""
    def rank(r):
        return (r["points"], r["noise_mm"] == 1, r["tolerance_mm"])
    chosen = []
    for source in sources(rows):
        of = [r for r in rows if (r["scene"], r["link"]) == source]
        first = max(map(rank, of))
        chosen += [r for r in of if rank(r) == first]
    return chosen


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("hard", "near", "deadline"):
        parser.add_argument(name, type=Path)
    for name in ("commit", "machine", "date"):
        parser.add_argument("--" + name, required=True)
    parser.add_argument("--folder", type=Path, required=True)
    arguments = parser.parse_args()

    hard, near, deadline = (read(path) for path in (arguments.hard, arguments.near,
                                                    arguments.deadline))
    for name, rows in (("hard", hard), ("near", near), ("deadline", deadline)):
        if rows:
            write(arguments.folder / f"benchmark_{name}.csv", rows, arguments)
    parts = {
        "benchmark hard run":
            f"Commit {arguments.commit}, {arguments.date}, {arguments.machine}.\n",
        "benchmark hard to 1 mm": hard_table(hard, 1),
        "benchmark hard exact": hard_table(hard, 0),
        "benchmark hard again": again_table(hard, 1),
        "benchmark hard checks":
            checks(hard, ("scene", "link", "points", "noise_mm", "tolerance_mm")),
        "benchmark deadline": deadline_table(deadline)}
    if near:
        parts["benchmark near to 1 mm"] = near_table(near, 1)
        parts["benchmark near exact"] = near_table(near, 0)
        parts["benchmark near checks"] = checks(near, ("robot", "distance_mm", "tolerance_mm"))
    fill(arguments.folder / "benchmark.md", parts)
    rows = plotted(deadline)
    preferred = [s for s in sources(rows) if s[1].startswith(("Panda", "demo"))]
    (arguments.folder / "benchmark_deadline.svg").write_text(
        DeadlinePlot(rows, preferred or sources(rows)[:5],
                     f"Width of the bounds against the deadline, {arguments.commit}").svg(),
        encoding="utf-8")


if __name__ == "__main__":
    main()
