"""Results in; text, tables, sentences, figures and HTML out. Degrees appear here, physics does not."""
