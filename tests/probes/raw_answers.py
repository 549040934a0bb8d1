"""A process that answers with whatever bytes it is told, then waits, then ends."""

from __future__ import annotations

import json
import os
import sys
import time

if __name__ == "__main__":
    job = json.loads(sys.argv[1])
    os.write(1, job["raw"].encode())
    time.sleep(job["seconds"])
