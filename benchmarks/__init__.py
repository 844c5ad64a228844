"""The benchmark that everyone can rerun: instance families, peers, suites, runner and report (``react-opt bench``)."""
