"""``python -m scenarionet_pipelines.cli``: the command line of a checkout that is not installed."""

from scenarionet_pipelines.cli import main

if __name__ == "__main__":  # worker processes import this module too
    main()
