"""Quality and cost of settings.

The effect of each setting of a job on speed and error, as tables, plots and a page: `framearray report`.
"""

from .page import report_table, write_report
from .settings import read_vary
from .survey import Report, make_report

__all__ = ["Report", "make_report", "read_vary", "report_table", "write_report"]
