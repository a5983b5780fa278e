"""The Gymnasium environments, of one robot and of many."""
