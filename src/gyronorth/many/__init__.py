"""Many recordings to rows of a table, on one process, on several or on a cluster.

`workers` and `running` give them to processes that may be lost, `headings` finds north in each, and `table` keeps what
is finished when all of it is killed.
"""

from gyronorth.many.headings import Request, heading_many

__all__ = ["Request", "heading_many"]


def __dir__() -> list[str]:
    return sorted(__all__)
