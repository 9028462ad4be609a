"""Columns of files: one reader of logs, whatever wrote them, for all that reads measurements."""
