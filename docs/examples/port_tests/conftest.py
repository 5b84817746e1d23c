pytest_plugins = ["refgi.testing"]
