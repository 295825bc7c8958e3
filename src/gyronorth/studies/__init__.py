"""Studies: one file for each table or figure that is reproduced or claimed; `benchmark` runs them."""
