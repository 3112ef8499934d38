"""`python -m psim` is `psim`."""

from psim.app import main

if __name__ == "__main__":
    main()
