import os

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # windows of the tests appear on no screen
