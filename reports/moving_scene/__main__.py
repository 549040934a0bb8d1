"""Lets `python -m reports.moving_scene` run the study."""

from reports.moving_scene.study import main

if __name__ == "__main__":
    raise SystemExit(main())
