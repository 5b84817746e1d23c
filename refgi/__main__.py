"""Run the command as `python -m refgi`."""

from refgi.cli import main

if __name__ == "__main__":  # not again in processes that compile
    main()
