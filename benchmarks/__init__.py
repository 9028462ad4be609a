"""Error against run time, stiff and extreme scenes, throughput.

Each module runs by itself: `python -m benchmarks.hits`.
"""
