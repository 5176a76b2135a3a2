"""The judge: checks one engine against the laws of mechanics, without any motion formula of the screw solver."""
