"""A report about a robot and a scene: see the program proximity_report."""
