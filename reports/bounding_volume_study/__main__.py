"""Lets `python -m reports.bounding_volume_study` run the study."""

from reports.bounding_volume_study.study import main

if __name__ == "__main__":
    raise SystemExit(main())
