"""Pictures of the robot (need the extra `render`)."""
