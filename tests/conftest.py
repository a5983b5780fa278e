import os

from hypothesis import settings

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # windows of the tests appear on no screen

# How many examples of hostile input are tried: few in every run, HYPOTHESIS_PROFILE=long for many.
settings.register_profile("short", max_examples=25, deadline=None, derandomize=True)
settings.register_profile("long", max_examples=2000, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "short"))
