"""``python -m pipelines.cli``: the command line of a checkout that is not installed."""

from pipelines.cli import main

if __name__ == "__main__":  # workers of a process pool import this module too
    main()
