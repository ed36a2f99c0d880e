"""`python -m framearray_cli` is `framearray`."""

from .cli import main

main()
