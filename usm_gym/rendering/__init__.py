"""Pictures of the robot; films and windows need the extra `render`."""
