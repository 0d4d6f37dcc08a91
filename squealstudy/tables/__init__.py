"""What the tables of a study say: rankings, crossings, maps, comparisons. Tables in, tables out."""
