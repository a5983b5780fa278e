"""Pictures of a spatial robot in perspective; frames need the extra `render`."""
