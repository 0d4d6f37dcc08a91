"""What a study's runs do by default and nothing heavy: study files are read without numpy."""

TOLERANCE = 1e-2  # imbalance at which a step's contact iteration ends: far below the step's error
SLOW_TOLERANCE = 1e-3  # the same of the slow references
