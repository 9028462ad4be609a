"""What is known of a loop without a run."""
