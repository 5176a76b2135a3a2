"""Built-in descriptions of mechanisms (TOML); writes, reads, checks and imports URDF, MJCF, SDF and USD files.

`catalog` loads descriptions; `layout` cuts their loops; `urdf` and `mjcf` write them; `generate` writes all files.
`readings` reads model files with the libraries; `importing` converts a model file to a description; `check` compares
model files with their description.
"""
