"""Built-in descriptions of mechanisms (TOML); writers, readers, checks and import of URDF, MJCF, SDF and USD.

`catalog` loads descriptions; `layout` cuts them, `urdf` and `mjcf` write them, `generate` writes all files; `readings`
reads any model file by the libraries, `importing` turns it into a description, `check` compares the two.
"""
