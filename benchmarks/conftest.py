"""Linear algebra on one thread, as the command line has it: a second one waits for its turn on a busy machine."""

import experiments  # noqa: F401  # before scipy is loaded
