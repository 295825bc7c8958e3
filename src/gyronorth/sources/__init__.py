"""What was named as a source: which recordings that is, and each of them at hand as a file.

`listing` finds the recordings, `remote` fetches those behind a URL, `cache` keeps what was fetched, and `reading`
gives the samples of one after the other.
"""
