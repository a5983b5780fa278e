"""What the robot is asked to do, what is seen of it, and how that is judged."""
