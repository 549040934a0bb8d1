"""Pictures and rays of several scenes beside Mitsuba and Embree, measured in turn."""
