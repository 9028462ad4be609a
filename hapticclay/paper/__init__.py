"""The paper, claim by claim, compared with the simulator."""
