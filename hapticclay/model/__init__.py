"""What a scene is: numbers, parts and experiments. No engine, no state of a loop."""
