"""Tables that tests read."""

import csv


def read_rows(path):
    """The rows of a CSV file as mappings."""
    with path.open(newline="") as lines:
        return list(csv.DictReader(lines))
