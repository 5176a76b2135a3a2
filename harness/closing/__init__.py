"""From an engine's open tree to the closed mechanism: what Pinocchio and MuJoCo need beyond their own calls."""
