"""Other tools on the jobs of problems.py, one file each; `python -m benchmarks.peers`."""
