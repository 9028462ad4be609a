"""What runs live: sessions and replays against the clock, devices beside them, and their stream."""
