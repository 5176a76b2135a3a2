"""The judge: checks one engine by the laws of mechanics, with no motion formula of the screw solver."""
