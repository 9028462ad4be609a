"""One run or many, and their records."""
