"""`python -m eddyscan` is `eddyscan`."""

from eddyscan.cli import main

main()
