"""Commands about scenes: `python -m geometry sample|show|check|import`."""

from flowslide.commands.scenes import main
from pipeline.cli import main_exit

if __name__ == "__main__":
    main_exit(main)
