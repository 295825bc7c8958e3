"""The live instrument: a stream of lines in; heading, recording, page and NMEA out. No physics.

Bytes come from a source (`sources`), become rows (`lines`) in order of time (`timeline`) and then
samples on a uniform grid (`stretch`), exactly as the offline reader makes them. Every good row
goes to disk as it came (`recorder`); the samples go to the streaming estimator (`estimation`).
`session` joins them, counts what went wrong, and publishes a `status` that the page and the
outputs show.
"""
