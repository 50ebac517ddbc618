"""The table of faults in doc/safety.md: its rows, which IST_PROXIMITY_UPDATE_DOC=1 makes the rostests write."""

import fcntl
import pathlib

DOCUMENT = pathlib.Path(__file__).resolve().parents[2] / "doc" / "safety.md"
BEGIN, END = "<!-- faults -->\n", "<!-- end of faults -->"
COLUMNS = ("fault", "what was done", "status", "at most", "measured", "recovery")
NONE = "-"


def milliseconds(value):
    return NONE if value is None else "%d ms" % round(value)


def row(record):
    """The cells of a record: a dictionary with fault, done, status, limit_ms, reaction_ms,
    recovery and recovery_ms, where times that do not apply are None."""
    recovery = record["recovery"]
    if record["recovery_ms"] is not None:
        recovery += ", %s" % milliseconds(record["recovery_ms"])
    cells = (record["fault"], record["done"], record["status"])
    cells += (milliseconds(record["limit_ms"]), milliseconds(record["reaction_ms"]), recovery)
    return [cell.replace("|", "/").replace("\n", " ") for cell in cells]


def read_rows(text):
    """Returns the cells by fault, in the document's order."""
    rows = {}
    table = text.split(BEGIN, 1)[1].split(END, 1)[0]
    for line in table.splitlines()[2:]:
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        rows[cells[0]] = cells
    return rows


def limit_ms(cells):
    """The documented reaction time of a row; None where the fault needs no reaction."""
    cell = cells[COLUMNS.index("at most")]
    return None if cell == NONE else float(cell.split()[0])


def table(rows):
    lines = ["| %s |" % " | ".join(COLUMNS), "|%s" % ("---|" * len(COLUMNS))]
    lines += ["| %s |" % " | ".join(cells) for cells in rows]
    return "\n".join(lines) + "\n"


def update(records, document=DOCUMENT):
    """Replaces or adds the rows of records, in the order of their names; processes take turns."""
    with open(document, "r+", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        text = file.read()
        rows = read_rows(text)
        rows.update({record["fault"]: row(record) for record in records})
        before, rest = text.split(BEGIN, 1)
        after = rest.split(END, 1)[1]
        file.seek(0)
        ordered = [rows[fault] for fault in sorted(rows, key=str.lower)]
        file.write(before + BEGIN + table(ordered) + END + after)
        file.truncate()
