"""One measurement in this process: ``python -m orchestrator.bench MODULE OPTIONS``."""

import sys

from orchestrator.bench.process import child

child(*sys.argv[1:])
