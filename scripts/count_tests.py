#!/usr/bin/env python3
"""Prints how many tests passed, failed and were skipped, from the XML results below a build folder.

Usage: count_tests.py BUILD_FOLDER [PATTERN...]   files in test_results, default: all
"""

import glob
import os
import sys
import xml.etree.ElementTree as ElementTree


def count(path):
    """(passed, failed, skipped) of one result file; a damaged file is one failure."""
    try:
        cases = list(ElementTree.parse(path).iter("testcase"))
    except ElementTree.ParseError:
        return 0, 1, 0
    failed = sum(c.find("failure") is not None or c.find("error") is not None for c in cases)
    skipped = sum(
        c.find("skipped") is not None or c.get("status") == "notrun" for c in cases
    )
    # rostest writes a summary beside the results of its tests: only what it says in addition, that
    # a test left no results, counts.
    if os.path.basename(path).startswith("rostest-"):
        return 0, failed, 0
    return len(cases) - failed - skipped, failed, skipped


def main():
    folder, patterns = sys.argv[1], sys.argv[2:] or ["*.xml"]
    files = set()
    for pattern in patterns:
        files.update(glob.glob(os.path.join(folder, "test_results", "*", pattern)))
    totals = [sum(column) for column in zip((0, 0, 0), *map(count, sorted(files)))]
    print(*totals)


if __name__ == "__main__":
    main()
