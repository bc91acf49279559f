"""The diagnosis on cars that another simulator drives."""
