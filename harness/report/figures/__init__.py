"""Diagrams as data, and the renderer that draws them as SVG."""
