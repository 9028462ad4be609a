"""The paper, claim by claim, beside what the simulator gives."""
