"""Diagrams as data, and the one renderer that draws any of them as SVG."""
