"""What a URDF or MJCF says, as each library reads it, in one engine-neutral form."""
