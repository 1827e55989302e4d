"""`python -m trdlab` is `trdlab`."""

from trdlab.cli import main

main()
