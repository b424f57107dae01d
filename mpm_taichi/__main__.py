"""Commands of the solver: `python -m mpm_taichi run|case|show|export|status|effects`."""

from flowslide.commands.simulation import main
from pipeline.cli import main_exit

if __name__ == "__main__":
    main_exit(main)
