"""Many recordings: sources to recordings to rows of a table, on one process, on several or on a cluster.

`sources` finds the recordings, `remote` fetches those behind a URL, `workers` and `running` give them to processes
that may be lost, `headings` finds north in each, and `table` keeps what is finished when all of it is killed.
"""

from gyronorth.many.headings import Request as Request
from gyronorth.many.headings import heading_many as heading_many
