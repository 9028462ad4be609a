"""Arms from files: mechanisms that MuJoCo loads, and the laws that drive their joints."""
