"""The method behind HTTP: a page for people, an interface for programs."""
