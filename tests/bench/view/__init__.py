"""The page of `framearray view` in Chromium, under a clock."""
