"""`python -m refgi` is the command `refgi`."""

from refgi.cli import main

if __name__ == "__main__":
    main()
