"""Built-in descriptions of mechanisms (TOML), and writers, readers, checks and import of URDF, MJCF, SDF and USD.

`catalog` loads descriptions; `layout` cuts their loops; `urdf` and `mjcf` write them; `generate` writes all files.
`readings` loads any model file with the libraries; `importing` converts it to a description; `check` compares both.
"""
