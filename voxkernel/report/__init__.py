"""A run in, a page, a Markdown text or JSON out. Knows of the run what `run_table` says."""

from voxkernel.report.write_report import write_report

__all__ = [
    "write_report",
]
