"""How many of many headings are valid, refused and why, or could not be had."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from gyronorth.many.table import TableWriter
from gyronorth.report.tables import Outcome


@dataclass
class Tally:
    """Counts of headings; exit codes as those of one."""

    valid: int = 0
    refused: int = 0
    failed: int = 0
    reasons: Counter[str] = field(default_factory=Counter)  # of the refused; one may have several

    def add(self, outcomes: Sequence[Outcome]) -> None:
        """Count some more."""
        for outcome in outcomes:
            found = outcome.estimate
            reasons = [] if found is None else [finding.code for finding in found.reasons]
            self._count(failed=found is None, valid=found is not None and found.valid, reasons=reasons)

    def of(self, table: TableWriter) -> Tally:
        """The counts of all rows of a table."""
        tally = Tally()
        columns = (table.column(name) for name in ("message", "method", "valid", "reasons"))
        for message, method, valid, reasons in zip(*columns, strict=True):
            codes = reasons.split(";") if reasons else []
            tally._count(failed=bool(message) and not method, valid=valid == "true", reasons=codes)
        return tally

    def summary(self) -> str:
        """One line for people."""
        total = self.valid + self.refused + self.failed
        causes = ", ".join(f"{code} {count}" for code, count in self.reasons.most_common())
        refused = f"{self.refused} refused" + (f" ({causes})" if causes else "")
        return f"{total} heading{'s' if total != 1 else ''}: {self.valid} valid, {refused}, {self.failed} failed"

    def exit_code(self) -> int:
        """2 if any could not be had, else 3 if any is not valid, else 0."""
        return 2 if self.failed else 3 if self.refused else 0

    def _count(self, *, failed: bool, valid: bool, reasons: Iterable[str]) -> None:
        self.failed += failed
        self.valid += valid
        self.refused += not failed and not valid
        self.reasons.update(reasons)


@dataclass
class Counts:
    """Counts of files of which something was had, or not."""

    what: str  # was done with them, in a word
    done: int = 0
    failed: int = 0

    def add(self, outcomes: Sequence[Any]) -> None:
        """Count some more."""
        for outcome in outcomes:
            self._count(failed=bool(outcome.message))

    def of(self, table: TableWriter) -> Counts:
        """The counts of all rows of a table."""
        counts = Counts(self.what)
        for message in table.column("message"):
            counts._count(failed=bool(message))
        return counts

    def summary(self) -> str:
        """One line for people."""
        total = self.done + self.failed
        return f"{total} file{'s' if total != 1 else ''}: {self.done} {self.what}, {self.failed} failed"

    def exit_code(self) -> int:
        """2 if any failed, else 0."""
        return 2 if self.failed else 0

    def _count(self, *, failed: bool) -> None:
        self.failed += failed
        self.done += not failed
