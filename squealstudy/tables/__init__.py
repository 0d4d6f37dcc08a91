"""Tables computed from tables: rankings, crossings, maps, comparisons."""
